// Tokens stand for a person or program at the HTTP door. A token is a random number of 256 bits
// that its bearer alone has. The file of tokens has its SHA-256, so who reads the file cannot ask.
//
//   name,role,made_s,expires_s,revoked_s,sha256
//   page,viewer,1700000000,1702592000,0,9f86d0..
//
// Times are seconds since 1970. A token that was revoked stays in the file, so that its name is not
// given anew and the audit keeps its meaning.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/access/role.h"
#include "protocol/base/result.h"

namespace focalfleet {

struct Token {
  std::string name;  // letters, digits, - . _
  Role role = Role::kViewer;
  std::int64_t made_s = 0;
  std::int64_t expires_s = 0;
  std::int64_t revoked_s = 0;  // 0: not
  std::string sha256;          // of the secret, in hex
  bool operator==(const Token&) const = default;
};

enum class TokenState : std::uint8_t { kValid, kExpired, kRevoked };
constexpr const char* Name(TokenState state) {
  constexpr const char* kNames[] = {"valid", "expired", "revoked"};
  return kNames[static_cast<std::size_t>(state)];
}
TokenState StateOf(const Token& token, std::int64_t now_s);

/// Errors: kInvalid names `file`, row, column and reason.
Result<std::vector<Token>> ParseTokens(std::string_view text, const std::string& file);
std::string FormatTokens(const std::vector<Token>& tokens);

/// A new token is among `tokens`. The result is its secret, which is not kept anywhere.
/// Errors: kInvalid: no possible name; kRefused: the name was given before; kUnavailable: the
/// system has no random numbers.
Result<std::string> AddToken(const std::string& name, Role role, std::int64_t now_s,
                             std::int64_t expires_s, std::vector<Token>* tokens);
/// Errors: kRefused: there is no such token, or it was revoked before.
Status RevokeToken(const std::string& name, std::int64_t now_s, std::vector<Token>* tokens);

/// The file of tokens. Errors: kUnavailable: missing, not readable; kInvalid: as ParseTokens, or
/// others than its owner may write it, who could make tokens for themselves.
Result<std::vector<Token>> ReadTokens(const std::string& path);

}  // namespace focalfleet
