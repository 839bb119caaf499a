// A role is the sum of what its bearer may do. Roles are in a row: each may do all that the ones
// before it may. rights.h says which role a verb needs.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace focalfleet {

enum class Role : std::uint8_t {
  kNone,      // nothing at all
  kViewer,    // looks on, and stops the fleet
  kOperator,  // moves the fleet by known ways
  kEngineer   // changes what the fleet is taken for
};
inline constexpr Role kLastRole = Role::kEngineer;

constexpr const char* Name(Role role) {
  constexpr const char* kNames[] = {"none", "viewer", "operator", "engineer"};
  return kNames[static_cast<std::size_t>(role)];
}

/// The role that somebody can have by this name; none: there is no such role.
constexpr std::optional<Role> RoleOf(std::string_view name) {
  for (const Role role : {Role::kViewer, Role::kOperator, Role::kEngineer})
    if (name == Name(role)) return role;
  return std::nullopt;
}

}  // namespace focalfleet
