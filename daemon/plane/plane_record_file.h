// The file of a plane's coordinator: its number, its epoch, the configuration under way, and the
// last one that is over. The file is replaced as a whole, at most three times a
// configuration, and once for each change of a target.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "daemon/store/lock_file.h"
#include "fleet/layout.h"
#include "fleet/plane/plane_coordinator.h"
#include "protocol/base/result.h"

namespace focalfleet {

class PlaneRecordFile {
 public:
  struct Content {
    std::uint64_t coordinator = 0;
    PlaneRecord record;
  };
  /// The file is locked for this process and read. Where it is missing, the coordinator is a new
  /// one with the number `otherwise`. Errors: kRefused: another process has it; kInvalid: the file
  /// is something else, or names a unit that `layout` has not; kUnavailable.
  static Result<std::unique_ptr<PlaneRecordFile>> Open(const std::string& path,
                                                       const Layout& layout,
                                                       std::uint64_t otherwise);

  [[nodiscard]] const Content& content() const { return content_; }
  /// The record is durable. Errors: kUnavailable, kFull; the earlier one is kept then.
  Status Keep(const PlaneRecord& record) const;

 private:
  PlaneRecordFile(std::string path, const Layout* layout)
      : path_(std::move(path)), layout_(*layout) {}

  std::string path_;
  const Layout& layout_;
  std::unique_ptr<store_internal::LockFile> lock_;
  Content content_;
};

}  // namespace focalfleet
