#include "daemon/doctor/identity.h"

#include <algorithm>

namespace focalfleet::doctor {

bool May(const Identity& user, const FileFacts& file, Access access) {
  if (user.uid == 0) return true;
  const bool member = std::ranges::find(user.groups, file.gid) != user.groups.end();
  const unsigned shift = user.uid == file.uid ? 6 : member ? 3 : 0;
  return (file.mode >> shift & static_cast<std::uint32_t>(access)) != 0;
}

}  // namespace focalfleet::doctor
