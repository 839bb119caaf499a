// One writer a store. The lock is the kernel's (flock), so it ends with its process however that
// ends; the file's content is only there to name the holder. The file stays when the lock goes: to
// remove it would let a third process lock a name that a second still waits behind.
#pragma once

#include <memory>
#include <string>

#include "protocol/base/result.h"

namespace focalfleet::store_internal {

class LockFile {
 public:
  /// Errors: kRefused: another process holds it, named by pid; kUnavailable: the file cannot be
  /// made.
  static Result<std::unique_ptr<LockFile>> Acquire(const std::string& path);
  LockFile(const LockFile&) = delete;
  LockFile& operator=(const LockFile&) = delete;
  ~LockFile();

 private:
  explicit LockFile(int descriptor) : descriptor_(descriptor) {}
  int descriptor_;
};

}  // namespace focalfleet::store_internal
