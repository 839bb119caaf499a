// The fleet as a disk describes it, read by SQL of its own, and the same as the rows that were
// committed describe it. The judge takes nothing from the daemon's store but the types of its rows:
// a mistake there must not hide itself here. Places, bindings and open intents have types, because
// other rules use them; the rows of all other tables are texts, of which only sameness counts. The
// histories of units, axes, parameters and tunings, and the times of rows, are not compared.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "daemon/soak/memory_disk.h"
#include "fleet/records.h"

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
    std::string reason;
    bool operator==(const Unit&) const = default;
  };
  std::map<std::uint32_t, Unit> units;
  using Table = std::map<std::string, std::string>;  // values by key, cells parted by |
  std::map<std::string, Table> others;
  bool operator==(const StoredPicture&) const = default;
};

/// How much of a store a picture has.
enum class Extent : std::uint8_t {
  kMotion,  // places, open intents and bindings
  kState,   // also the other tables that hold one row a thing
  kAll      // also those that grow: configurations, alarms, measurements, ended intents, the audit
};

/// The place of a row as the disk has it.
StoredPlace PlaceOf(const VectorRow& vector);

/// Enters the rows of one transaction, of which ends of intents are written last.
void Enter(std::span<const Row> rows, Extent extent, StoredPicture* picture);

/// The first thing in which the two differ, for people; empty: nothing.
std::string FirstDifference(const StoredPicture& acknowledged, const StoredPicture& read);

class PictureReader {
 public:
  PictureReader() : disk_("focalfleet-picture") {}
  /// None: the picture is no store (it was never written, or it is damaged); `why` says so.
  std::optional<StoredPicture> Read(DiskPicture picture, Extent extent, std::string* why);

 private:
  MemoryDisk disk_;
};

}  // namespace focalfleet::soak
