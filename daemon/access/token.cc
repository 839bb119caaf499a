#include "daemon/access/token.h"

#include <fcntl.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>

#include "daemon/access/sha256.h"

namespace focalfleet {
namespace {

constexpr std::string_view kHeader = "name,role,made_s,expires_s,revoked_s,sha256";
constexpr std::size_t kColumns = 6;
constexpr std::size_t kNameBytes = 64;
constexpr std::size_t kFileBytes = std::size_t{1} << 20;  // 10,000 tokens
constexpr std::size_t kSecretBytes = 32;
constexpr std::string_view kPrefix = "fft_";  // by which scanners find a token that was published

bool IsTokenName(std::string_view name) {
  return !name.empty() && name.size() <= kNameBytes && std::ranges::all_of(name, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' ||
           c == '.' || c == '_';
  });
}

bool IsSha256(std::string_view text) {
  return text.size() == 64 && std::ranges::all_of(text, [](char c) {
           return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f');
         });
}

std::optional<std::int64_t> SecondsIn(std::string_view text) {
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || value < 0) return std::nullopt;
  return value;
}

std::vector<std::string_view> CellsIn(std::string_view line) {
  std::vector<std::string_view> cells;
  for (;;) {
    const std::size_t comma = line.find(',');
    cells.push_back(line.substr(0, comma));
    if (comma == std::string_view::npos) return cells;
    line.remove_prefix(comma + 1);
  }
}

/// The token of a row, or the column at fault and what it must be.
tl::expected<Token, std::string> TokenIn(std::string_view line) {
  const auto cells = CellsIn(line);
  if (cells.size() != kColumns)
    return tl::unexpected<std::string>("a row has " + std::to_string(kColumns) + " columns");
  const auto role = RoleOf(cells[1]);
  const auto made = SecondsIn(cells[2]);
  const auto expires = SecondsIn(cells[3]);
  const auto revoked = SecondsIn(cells[4]);
  if (!IsTokenName(cells[0]))
    return tl::unexpected<std::string>("name: letters, digits, - . _, at most 64");
  if (!role) return tl::unexpected<std::string>("role: viewer, operator or engineer");
  if (!made || !expires || !revoked)
    return tl::unexpected<std::string>("made_s, expires_s, revoked_s: whole seconds since 1970");
  if (!IsSha256(cells[5])) return tl::unexpected<std::string>("sha256: 64 hexadecimal digits");
  return Token{std::string(cells[0]), *role, *made, *expires, *revoked, std::string(cells[5])};
}

}  // namespace

TokenState StateOf(const Token& token, std::int64_t now_s) {
  if (token.revoked_s != 0) return TokenState::kRevoked;
  return now_s < token.expires_s ? TokenState::kValid : TokenState::kExpired;
}

Result<std::vector<Token>> ParseTokens(std::string_view text, const std::string& file) {
  std::vector<Token> tokens;
  std::size_t row = 0;
  const auto fail = [&](const std::string& why) {
    return Fail(ErrorCode::kInvalid, file + ":" + std::to_string(row) + ": " + why);
  };
  while (!text.empty()) {
    ++row;
    const std::size_t end = text.find('\n');
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    if (row == 1) {
      if (line != kHeader) return fail("the first row must be " + std::string(kHeader));
      continue;
    }
    const auto token = TokenIn(line);
    if (!token) return fail(token.error());
    if (std::ranges::find(tokens, token->name, &Token::name) != tokens.end())
      return fail("name: " + token->name + " is there twice");
    tokens.push_back(*token);
  }
  if (row == 0) return fail("the first row must be " + std::string(kHeader));
  return tokens;
}

std::string FormatTokens(const std::vector<Token>& tokens) {
  std::string text = std::string(kHeader) + "\n";
  for (const Token& token : tokens)
    text += token.name + "," + Name(token.role) + "," + std::to_string(token.made_s) + "," +
            std::to_string(token.expires_s) + "," + std::to_string(token.revoked_s) + "," +
            token.sha256 + "\n";
  return text;
}

Result<std::string> AddToken(const std::string& name, Role role, std::int64_t now_s,
                             std::int64_t expires_s, std::vector<Token>* tokens) {
  if (!IsTokenName(name))
    return Fail(ErrorCode::kInvalid,
                "'" + name + "' is no name of a token: letters, digits, - . _, at most 64");
  if (std::ranges::find(*tokens, name, &Token::name) != tokens->end())
    return Fail(ErrorCode::kRefused, "there is a token " + name + " already, or was once");
  std::array<unsigned char, kSecretBytes> random{};
  if (::getrandom(random.data(), random.size(), 0) != static_cast<ssize_t>(random.size()))
    return Fail(ErrorCode::kUnavailable, std::string("no random numbers: ") + std::strerror(errno));
  std::string secret(kPrefix);
  for (const unsigned char byte : random) {
    constexpr std::string_view kDigits = "0123456789abcdef";
    secret += kDigits[byte >> 4];
    secret += kDigits[byte & 15];
  }
  tokens->push_back({name, role, now_s, expires_s, 0, Sha256Hex(secret)});
  return secret;
}

Status RevokeToken(const std::string& name, std::int64_t now_s, std::vector<Token>* tokens) {
  const auto token = std::ranges::find(*tokens, name, &Token::name);
  if (token == tokens->end()) return Fail(ErrorCode::kRefused, "there is no token " + name);
  if (token->revoked_s != 0)
    return Fail(ErrorCode::kRefused, "the token " + name + " was revoked before");
  token->revoked_s = now_s;
  return {};
}

Result<std::vector<Token>> ReadTokens(const std::string& path) {
  const auto fail = [&](const std::string& why) {
    return Fail(ErrorCode::kUnavailable, path + ": " + why);
  };
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
  if (file < 0) return fail(std::strerror(errno));
  std::string text;
  struct stat status {};
  const bool regular = ::fstat(file, &status) == 0 && S_ISREG(status.st_mode);
  if (regular) text.resize(std::min(static_cast<std::size_t>(status.st_size), kFileBytes));
  const ssize_t got = regular ? ::pread(file, text.data(), text.size(), 0) : -1;
  ::close(file);
  if (!regular) return fail("no file");
  if (got != status.st_size) return fail("cannot be read as a whole");
  if ((status.st_mode & (S_IWGRP | S_IWOTH)) != 0)
    return Fail(ErrorCode::kInvalid,
                path + ": others than its owner may write it, and could make tokens: chmod go-w");
  return ParseTokens(text, path);
}

}  // namespace focalfleet
