// The fleet as a disk describes it, read by SQL of its own. The judge takes nothing from the
// daemon's store: a mistake there must not hide itself here.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "daemon/soak/memory_disk.h"

namespace focalfleet::soak {

/// An axis as stored. Units: vectors.
struct StoredAxis {
  int witness = 0;  // 0 unknown, 1 interval, 2 predicted, 3 reported, 4 measured
  std::int64_t low = 0;
  std::int64_t high = 0;
  bool operator==(const StoredAxis&) const = default;
};
using StoredPlace = std::array<StoredAxis, 2>;

inline bool IsExact(const StoredPlace& place) {
  return place[0].witness >= 3 && place[1].witness >= 3;
}

/// An open intent.
struct StoredIntent {
  std::uint32_t unit = 0;
  std::uint32_t move = 0;
  std::array<std::int64_t, 2> low{};
  std::array<std::int64_t, 2> high{};
  bool operator==(const StoredIntent&) const = default;
};

struct StoredPicture {
  std::map<std::uint32_t, StoredPlace> places;    // by serial
  std::map<std::uint32_t, StoredIntent> intents;  // open ones, by serial
  struct Unit {
    std::uint32_t serial = 0;
    bool enabled = true;
    bool operator==(const Unit&) const = default;
  };
  std::map<std::uint32_t, Unit> units;
  bool operator==(const StoredPicture&) const = default;
};

class PictureReader {
 public:
  PictureReader() : disk_("focalfleet-picture") {}
  /// None: the picture is no store (it was never written, or it is damaged); `why` says so.
  std::optional<StoredPicture> Read(DiskPicture picture, std::string* why);

 private:
  MemoryDisk disk_;
};

}  // namespace focalfleet::soak
