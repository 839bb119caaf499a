#include "daemon/access/role_groups.h"

#include <grp.h>
#include <sys/types.h>

#include <algorithm>
#include <charconv>

namespace focalfleet {
namespace {

constexpr std::size_t kGroupBytes = std::size_t{1} << 20;  // a group may have thousands of members

std::optional<std::uint32_t> GroupOf(const std::string& name) {
  std::uint32_t number = 0;
  const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), number);
  if (!name.empty() && error == std::errc() && end == name.data() + name.size()) return number;
  std::vector<char> room(kGroupBytes);
  group found{};
  group* result = nullptr;
  if (::getgrnam_r(name.c_str(), &found, room.data(), room.size(), &result) != 0 ||
      result == nullptr)
    return std::nullopt;
  return found.gr_gid;
}

}  // namespace

Result<RoleGroups> RoleGroups::Find(const Names& names, std::uint32_t own_uid) {
  RoleGroups groups;
  groups.own_uid_ = own_uid;
  const struct {
    const char* key;
    const std::vector<std::string>& names;
    Role role;
  } lists[] = {{"viewers", names.viewers, Role::kViewer},
               {"operators", names.operators, Role::kOperator},
               {"engineers", names.engineers, Role::kEngineer}};
  for (const auto& [key, list, role] : lists)
    for (const std::string& name : list) {
      const auto group = GroupOf(name);
      if (!group)
        return Fail(ErrorCode::kInvalid,
                    std::string("control.") + key + ": this machine has no group '" + name + "'");
      groups.roles_.emplace_back(*group, role);
    }
  return groups;
}

Role RoleGroups::RoleOf(const std::optional<Peer>& peer) const {
  if (!in_use()) return Role::kEngineer;
  if (!peer) return Role::kNone;
  if (peer->uid == 0 || peer->uid == own_uid_) return Role::kEngineer;
  Role role = Role::kNone;
  for (const auto& [group, of_group] : roles_)
    if (group == peer->gid || std::ranges::find(peer->groups, group) != peer->groups.end())
      role = std::max(role, of_group);
  return role;
}

}  // namespace focalfleet
