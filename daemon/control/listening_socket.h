// A UNIX stream socket that listens at a path.
//
// Owner and group may connect, unless another mode is given. A socket file that a live server
// answers on is refused as in use. A file that no process answers on was left by a crash and is
// replaced. The new socket listens under a temporary name and is renamed into place, so no client
// ever finds a socket file that does not answer.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <string>
#include <utility>

#include "daemon/control/unix_address.h"
#include "protocol/base/result.h"

namespace focalfleet {

class ListeningSocket {
 public:
  /// Errors: kRefused where a live server answers at `path`; kUnavailable where the path is no
  /// socket, too long or not writable; both name it.
  static Result<ListeningSocket> Create(const std::string& path, std::uint32_t mode = 0660);
  ListeningSocket(ListeningSocket&& other) noexcept;
  ListeningSocket& operator=(ListeningSocket&& other) noexcept;
  ListeningSocket(const ListeningSocket&) = delete;
  ListeningSocket& operator=(const ListeningSocket&) = delete;
  /// Removes the socket file, if it still is the one that this made.
  ~ListeningSocket();

  /// The descriptor of the next connection, which does not block; -1 with errno where there is
  /// none.
  [[nodiscard]] int Accept() const;

  [[nodiscard]] int fd() const { return fd_; }
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  explicit ListeningSocket(std::string path) : path_(std::move(path)) {}
  Status Listen(const UnixAddress& temporary, const std::string& temporary_path,
                std::uint32_t mode);

  std::string path_;
  int fd_ = -1;
  dev_t device_ = 0;
  ino_t inode_ = 0;  // 0: there is no file of this socket
};

}  // namespace focalfleet
