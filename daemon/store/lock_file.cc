#include "daemon/store/lock_file.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

namespace focalfleet::store_internal {
namespace {

std::string HolderOf(int descriptor) {
  char text[32] = {};
  const ssize_t length = pread(descriptor, text, sizeof text - 1, 0);
  std::string pid;
  for (ssize_t i = 0; i < length && text[i] >= '0' && text[i] <= '9'; ++i) pid += text[i];
  return pid.empty() ? "another process" : "process " + pid;
}

}  // namespace

Result<std::unique_ptr<LockFile>> LockFile::Acquire(const std::string& path) {
  const int descriptor = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0644);
  if (descriptor < 0) {
    return Fail(ErrorCode::kUnavailable, path + ": " + std::strerror(errno));
  }
  auto lock = std::unique_ptr<LockFile>(new LockFile(descriptor));
  while (flock(descriptor, LOCK_EX | LOCK_NB) != 0) {
    if (errno == EINTR) continue;
    if (errno != EWOULDBLOCK) {
      return Fail(ErrorCode::kUnavailable, path + ": " + std::strerror(errno));
    }
    return Fail(ErrorCode::kRefused,
                path + " is held by " + HolderOf(descriptor) + ": one daemon a store");
  }
  const std::string pid = std::to_string(getpid()) + "\n";
  // The lock holds without the pid in it: a daemon on a full disk must start, to report the disk.
  if (ftruncate(descriptor, 0) == 0 && pwrite(descriptor, pid.data(), pid.size(), 0) < 0) {
    return lock;
  }
  return lock;
}

LockFile::~LockFile() { close(descriptor_); }

}  // namespace focalfleet::store_internal
