// The store judge remembers what the store has acknowledged, and compares it with what each new
// process reads from the disk. The rule is:
//
//   durable    What was acknowledged as committed is there after every kill and power cut, in every
//              table that a start reads, and nothing that was not offered is there.
//
// A commit that failed may be there or not. A process that reads it writes the log once more before
// it begins, so from then on it counts as acknowledged.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "daemon/soak/memory_disk.h"
#include "daemon/soak/stored_picture.h"
#include "fleet/records.h"

namespace focalfleet::soak {

class StoreJudge {
 public:
  using Broken = std::function<void(const std::string& rule, const std::string& what)>;
  /// `extent`: what survives kills. With kAll the judge remembers all rows of a night.
  StoreJudge(const MemoryDisk* disk, Extent extent, Broken broken)
      : disk_(disk), extent_(extent), broken_(std::move(broken)) {}

  void Commits(std::span<const Row> rows);
  void Committed(std::span<const Row> rows, bool done);
  /// A process starts on this disk: what it reads is judged. Until the process has begun, nothing
  /// of that is acknowledged: it may stand in pages that the disk has dropped.
  void LifeBegins();
  void LifeHasBegun();

  /// The store as a power cut now would leave it. Null: there is none.
  const StoredPicture* Durable();
  /// The fleet as last acknowledged by the store.
  [[nodiscard]] const StoredPicture& acknowledged() const { return acknowledged_; }
  /// Open intents of the hardware that is bound to places, as last acknowledged. Hardware that was
  /// replaced keeps its open intent for the day when it is put in again.
  [[nodiscard]] std::size_t IntentsOpen() const;

 private:
  void Compare(const StoredPicture& read) const;

  const MemoryDisk* disk_;
  Extent extent_;
  Broken broken_;
  PictureReader reader_;
  std::optional<StoredPicture> durable_;
  std::uint64_t durable_syncs_ = UINT64_MAX;
  StoredPicture acknowledged_;
  std::vector<Row> in_flight_;         // the batch that is being committed
  std::optional<StoredPicture> read_;  // by the process that starts
};

}  // namespace focalfleet::soak
