#include "daemon/access/token_register.h"

#include <sys/stat.h>

#include <algorithm>

#include "daemon/access/sha256.h"

namespace focalfleet {
namespace {

/// Addresses and tokens with a bucket of their own; further ones share one.
constexpr std::size_t kBuckets = 1024;
constexpr std::int64_t kSecondNs = 1'000'000'000;

/// Takes as long whatever differs. Pre: equal lengths.
bool AreEqual(std::string_view a, std::string_view b) {
  unsigned char differs = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    differs = static_cast<unsigned char>(
        differs | (static_cast<unsigned char>(a[i]) ^ static_cast<unsigned char>(b[i])));
  return differs == 0;
}

}  // namespace

void TokenRegister::Refresh() {
  struct stat status {};
  Identity now;
  if (::stat(options_.path.c_str(), &status) == 0)
    now = {status.st_ino, status.st_size,
           std::int64_t{status.st_ctim.tv_sec} * kSecondNs + status.st_ctim.tv_nsec};
  if (now == identity_ && readable_ && now.inode != 0) return;
  auto tokens = ReadTokens(options_.path);
  identity_ = now;
  readable_ = tokens ? Status() : Status(tl::unexpected<Error>(tokens.error()));
  tokens_ = tokens ? std::move(*tokens) : std::vector<Token>();
}

Result<TokenRegister::Found> TokenRegister::Find(std::string_view secret, WallTime now) {
  const std::string hash = Sha256Hex(secret);
  const std::lock_guard lock(mutex_);
  Refresh();
  if (!readable_) return tl::unexpected<Error>(readable_.error());
  const Token* found = nullptr;
  for (const Token& token : tokens_)
    if (AreEqual(token.sha256, hash)) found = &token;
  if (found == nullptr) return Fail(ErrorCode::kRefused, "nobody has this token");
  const TokenState state = StateOf(*found, now.ns / kSecondNs);
  if (state != TokenState::kValid)
    return Fail(ErrorCode::kRefused, "token " + found->name + " is " + Name(state));
  return Found{found->name, found->role};
}

bool TokenRegister::Use(const Budget& budget, const std::string& name, WallTime now, Buckets* in) {
  // Buckets that are full again tell nothing.
  if (in->size() >= kBuckets)
    std::erase_if(*in, [&](const auto& entry) {
      const double since_s = static_cast<double>(now.ns - entry.second.at_ns) * 1e-9;
      return entry.second.left + since_s * budget.per_second >= budget.burst;
    });
  const bool own = in->size() < kBuckets || in->contains(name);
  const auto [entry, fresh] = in->try_emplace(own ? name : "", Bucket{budget.burst, now.ns});
  Bucket& bucket = entry->second;
  const double since_s = std::max(0.0, static_cast<double>(now.ns - bucket.at_ns) * 1e-9);
  bucket = {std::min(budget.burst, bucket.left + since_s * budget.per_second), now.ns};
  if (bucket.left < 1) return false;
  bucket.left -= 1;
  return true;
}

bool TokenRegister::MayTry(const std::string& address, WallTime now) {
  const std::lock_guard lock(mutex_);
  return Use(options_.attempts, address, now, &attempts_);
}

bool TokenRegister::MayAsk(const std::string& name, WallTime now) {
  const std::lock_guard lock(mutex_);
  return Use(options_.requests, name, now, &requests_);
}

}  // namespace focalfleet
