// The roles of users by their groups. Where no group has a role, roles are not in use: whoever the
// socket's file lets in may do everything. Root and the user of the daemon itself may always do
// everything: nothing in the daemon could keep them from it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "daemon/access/peer.h"
#include "daemon/access/role.h"
#include "protocol/base/result.h"

namespace focalfleet {

class RoleGroups {
 public:
  /// Groups by their names or numbers.
  struct Names {
    std::vector<std::string> viewers;
    std::vector<std::string> operators;
    std::vector<std::string> engineers;
    [[nodiscard]] bool empty() const {
      return viewers.empty() && operators.empty() && engineers.empty();
    }
  };

  /// No group has a role.
  RoleGroups() = default;
  /// Errors: kInvalid names a group that this machine does not have, with its list.
  static Result<RoleGroups> Find(const Names& names, std::uint32_t own_uid);

  /// The highest role of the peer's groups. Without a peer: none where roles are in use.
  [[nodiscard]] Role RoleOf(const std::optional<Peer>& peer) const;
  [[nodiscard]] bool in_use() const { return !roles_.empty(); }

 private:
  std::vector<std::pair<std::uint32_t, Role>> roles_;  // by group
  std::uint32_t own_uid_ = 0;
};

}  // namespace focalfleet
