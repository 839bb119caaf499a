// The memory of a sector in a plane: the number of the daemon's life, and the epoch that it
// has accepted. The file `<store.path>.sector` has both; it is replaced as a whole.
#pragma once

#include <cstdint>
#include <string>

#include "fleet/plane/plane_messages.h"
#include "protocol/base/result.h"

namespace focalfleet {

class SectorMemory {
 public:
  /// A life begins: its number is one more than that of the last one, durably. A missing file is
  /// the first life. Errors: kInvalid: the file is something else; kUnavailable, kFull.
  static Result<SectorMemory> BeginLife(const std::string& path);

  [[nodiscard]] std::uint64_t life() const { return life_; }
  [[nodiscard]] const PlaneEpoch& epoch() const { return epoch_; }
  /// The epoch is durable. Errors: kUnavailable, kFull; the earlier one is kept then.
  Status Keep(const PlaneEpoch& epoch);

 private:
  explicit SectorMemory(std::string path) : path_(std::move(path)) {}
  [[nodiscard]] Status Write(std::uint64_t life, const PlaneEpoch& epoch) const;

  std::string path_;
  std::uint64_t life_ = 0;
  PlaneEpoch epoch_;
};

}  // namespace focalfleet
