// The name of a UNIX socket as the kernel wants it: 107 bytes at most, which a deep directory
// easily exceeds.
#pragma once

#include <sys/socket.h>
#include <sys/un.h>

#include <cstring>
#include <string>

#include "protocol/base/result.h"

namespace focalfleet {

class UnixAddress {
 public:
  /// The address of a path. Errors: kInvalid where the path is empty or too long.
  static Result<UnixAddress> Of(const std::string& path) {
    UnixAddress address;
    if (path.empty() || path.size() >= sizeof address.raw_.sun_path)
      return Fail(ErrorCode::kInvalid, "a socket's path has 1 to " +
                                           std::to_string(sizeof address.raw_.sun_path - 1) +
                                           " bytes; this one does not: '" + path + "'");
    address.raw_.sun_family = AF_UNIX;
    std::memcpy(address.raw_.sun_path, path.data(), path.size());
    return address;
  }

  [[nodiscard]] const sockaddr* get() const {
    return static_cast<const sockaddr*>(static_cast<const void*>(&raw_));
  }
  [[nodiscard]] static socklen_t length() { return sizeof(sockaddr_un); }

 private:
  UnixAddress() = default;
  sockaddr_un raw_{};
};

}  // namespace focalfleet
