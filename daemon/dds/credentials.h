// The credentials of a participant for DDS Security: a folder with files of fixed names, as
// deploy/dds-security/make-keys writes them.
//
//   identity_ca.pem, permissions_ca.pem    the authorities of the site
//   certificate.pem, key.pem               this participant's identity
//   governance.p7s, permissions.p7s        the rules of the domain, and what this participant may
//
// DDS reads them when a participant is made, never again. When one of them ends, DDS cuts the
// participant off and reports nothing; a write still succeeds. The ends are therefore watched here.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "daemon/clock/wall_time.h"
#include "fleet/coordinate/inputs.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// The properties of a participant with these credentials, by name.
std::vector<std::pair<std::string, std::string>> SecurityProperties(const std::string& folder);

struct CredentialEnd {
  std::string what;       // the file
  std::int64_t at_s = 0;  // since 1970
  bool operator==(const CredentialEnd&) const = default;
};

/// The ends of all certificates and permissions, the soonest first. Errors: kUnavailable, kInvalid
/// name the file.
Result<std::vector<CredentialEnd>> ReadCredentialEnds(const std::string& folder);

/// The soonest `not_after` of permissions. Errors: kInvalid: there is none, or no time.
Result<std::int64_t> EndOfPermissions(std::string_view text);

/// A text that differs where the files differ, by their identities and times of change.
std::string CredentialState(const std::string& folder);

/// Warns 14 days, 1 day and 1 hour before the end, and at the end; each once.
class CredentialClock {
 public:
  /// The note that is due; none: nothing new. Pre: there is an end.
  std::optional<ShellNote> Look(const std::vector<CredentialEnd>& ends, WallTime now);

 private:
  int stage_ = 0;  // warnings so far
};

}  // namespace focalfleet
