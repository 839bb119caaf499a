// The lock that gives a store one writer. The lock is the kernel's (flock), so it ends with its
// process however that ends; the file's content only names the holder. The file stays when the lock
// goes: to remove it would let a third process lock a name that a second one still waits for.
#pragma once

#include <memory>
#include <string>

#include "protocol/base/result.h"

namespace focalfleet::store_internal {

class LockFile {
 public:
  /// The lock is held. Errors: kRefused: another process holds it, named by pid; kUnavailable: the
  /// file cannot be made.
  static Result<std::unique_ptr<LockFile>> Acquire(const std::string& path);
  LockFile(const LockFile&) = delete;
  LockFile& operator=(const LockFile&) = delete;
  ~LockFile();

 private:
  explicit LockFile(int descriptor) : descriptor_(descriptor) {}
  int descriptor_;
};

}  // namespace focalfleet::store_internal
