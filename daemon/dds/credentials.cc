#include "daemon/dds/credentials.h"

#include <openssl/pem.h>
#include <openssl/x509.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <fstream>
#include <iterator>
#include <memory>

namespace focalfleet {
namespace {

constexpr const char* kIdentityCa = "identity_ca.pem";
constexpr const char* kPermissionsCa = "permissions_ca.pem";
constexpr const char* kCertificate = "certificate.pem";
constexpr const char* kKey = "key.pem";
constexpr const char* kGovernance = "governance.p7s";
constexpr const char* kPermissions = "permissions.p7s";

constexpr std::int64_t kHourS = 3600;
/// The least time to the end of each stage. 14 days take in a run of nights, a day is one more
/// chance by daylight, an hour is the last call.
constexpr std::array<std::int64_t, 4> kStages = {14 * 24 * kHourS, 24 * kHourS, kHourS, 0};
constexpr std::size_t kPermissionsBytesMax = std::size_t{1} << 20;

Result<std::int64_t> EndOfCertificate(const std::string& path) {
  const std::unique_ptr<FILE, int (*)(FILE*)> file(std::fopen(path.c_str(), "re"), &std::fclose);
  if (file == nullptr) return Fail(ErrorCode::kUnavailable, path + ": " + std::strerror(errno));
  const std::unique_ptr<X509, void (*)(X509*)> certificate(
      PEM_read_X509(file.get(), nullptr, nullptr, nullptr), &X509_free);
  std::tm end{};
  if (certificate == nullptr || ASN1_TIME_to_tm(X509_get0_notAfter(certificate.get()), &end) != 1)
    return Fail(ErrorCode::kInvalid, path + ": no certificate in PEM");
  return std::int64_t{::timegm(&end)};
}

Result<std::string> TextOf(const std::string& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0)
    return Fail(ErrorCode::kUnavailable, path + ": " + std::strerror(errno));
  if (!S_ISREG(status.st_mode) || static_cast<std::size_t>(status.st_size) > kPermissionsBytesMax)
    return Fail(ErrorCode::kInvalid, path + ": no document of permissions");
  std::ifstream file(path, std::ios::binary);
  std::string text{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  if (!file.good() && !file.eof()) return Fail(ErrorCode::kUnavailable, path + ": cannot be read");
  return text;
}

std::string TimeLeft(std::int64_t left_s) {
  if (left_s >= 48 * kHourS) return std::to_string(left_s / (24 * kHourS)) + " days";
  if (left_s >= 2 * kHourS) return std::to_string(left_s / kHourS) + " hours";
  return std::to_string(std::max<std::int64_t>(left_s / 60, 0)) + " minutes";
}

}  // namespace

std::vector<std::pair<std::string, std::string>> SecurityProperties(const std::string& folder) {
  const auto file = [&](const char* name) { return "file:" + folder + "/" + name; };
  std::vector<std::pair<std::string, std::string>> properties;
  for (const auto& [plugin, library, function] :
       {std::array<std::string, 3>{"auth", "dds_security_auth", "authentication"},
        std::array<std::string, 3>{"access", "dds_security_ac", "access_control"},
        std::array<std::string, 3>{"crypto", "dds_security_crypto", "crypto"}}) {
    const std::string base = "dds.sec." + plugin + ".library.";
    properties.emplace_back(base + "path", library);
    properties.emplace_back(base + "init", "init_" + function);
    properties.emplace_back(base + "finalize", "finalize_" + function);
  }
  properties.emplace_back("dds.sec.auth.identity_ca", file(kIdentityCa));
  properties.emplace_back("dds.sec.auth.identity_certificate", file(kCertificate));
  properties.emplace_back("dds.sec.auth.private_key", file(kKey));
  properties.emplace_back("dds.sec.access.permissions_ca", file(kPermissionsCa));
  properties.emplace_back("dds.sec.access.governance", file(kGovernance));
  properties.emplace_back("dds.sec.access.permissions", file(kPermissions));
  return properties;
}

Result<std::int64_t> EndOfPermissions(std::string_view text) {
  constexpr std::string_view kOpen = "<not_after>";
  std::optional<std::int64_t> soonest;
  for (std::size_t at = text.find(kOpen); at != std::string_view::npos;
       at = text.find(kOpen, at + 1)) {
    const std::string time(text.substr(at + kOpen.size(), std::size_t{40}));
    std::tm end{};
    const char* const rest = ::strptime(time.c_str(), " %Y-%m-%dT%H:%M:%S", &end);
    if (rest == nullptr)
      return Fail(ErrorCode::kInvalid, "not_after is no time such as 2030-01-31T12:00:00");
    const std::int64_t at_s = ::timegm(&end);
    soonest = std::min(soonest.value_or(at_s), at_s);
  }
  if (!soonest) return Fail(ErrorCode::kInvalid, "it has no not_after");
  return *soonest;
}

Result<std::vector<CredentialEnd>> ReadCredentialEnds(const std::string& folder) {
  std::vector<CredentialEnd> ends;
  for (const char* name : {kCertificate, kIdentityCa, kPermissionsCa}) {
    FOCALFLEET_TRY_ASSIGN(const std::int64_t end, EndOfCertificate(folder + "/" + name));
    ends.push_back({name, end});
  }
  const std::string path = folder + "/" + kPermissions;
  FOCALFLEET_TRY_ASSIGN(const std::string text, TextOf(path));
  const auto end = EndOfPermissions(text);
  if (!end) return Fail(end.error().code, path + ": " + end.error().text);
  ends.push_back({kPermissions, *end});
  std::ranges::stable_sort(ends, {}, &CredentialEnd::at_s);
  return ends;
}

std::string CredentialState(const std::string& folder) {
  std::string state;
  for (const char* name :
       {kIdentityCa, kPermissionsCa, kCertificate, kKey, kGovernance, kPermissions}) {
    struct stat status {};
    if (::stat((folder + "/" + name).c_str(), &status) != 0) status = {};
    state += std::to_string(status.st_ino) + " " + std::to_string(status.st_size) + " " +
             std::to_string(status.st_mtim.tv_sec) + "." + std::to_string(status.st_mtim.tv_nsec) +
             "\n";
  }
  return state;
}

std::optional<ShellNote> CredentialClock::Look(const std::vector<CredentialEnd>& ends,
                                               WallTime now) {
  const CredentialEnd& first = ends.front();
  const std::int64_t left_s = first.at_s - now.ns / 1'000'000'000;
  const auto stage = static_cast<int>(
      std::ranges::count_if(kStages, [&](std::int64_t least_s) { return left_s <= least_s; }));
  if (stage == stage_) return std::nullopt;
  const int before = std::exchange(stage_, stage);
  const bool was_over = before == static_cast<int>(kStages.size());
  const AlarmName open =
      was_over ? AlarmName::kDdsCredentialsEnded : AlarmName::kDdsCredentialsEnding;
  const std::string which = first.what + " of DDS Security";
  const std::string when = ToIso8601({first.at_s * 1'000'000'000});
  if (stage == static_cast<int>(kStages.size()))
    return ShellNote{
        AlarmName::kDdsCredentialsEnded,
        which + " ended at " + when + ": DDS has cut this daemon off, and nothing is published",
        AlarmName::kDdsCredentialsEnding};
  if (stage > before || (was_over && stage > 0))
    return ShellNote{AlarmName::kDdsCredentialsEnding,
                     which + " ends in " + TimeLeft(left_s) + ", at " + when + ": renew it",
                     was_over ? std::optional(open) : std::nullopt};
  if (stage > 0) return std::nullopt;  // renewed for a shorter time than usual
  return ShellNote{AlarmName::kDdsCredentialsRenewed,
                   "credentials of DDS Security are good until " + when, open};
}

}  // namespace focalfleet
