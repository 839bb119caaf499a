#include "daemon/campaign/recorded_campaign.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <optional>
#include <string_view>

#include "daemon/campaign/campaign_log.h"
#include "fleet/drive.h"
#include "fleet/measurement.h"

namespace focalfleet {
namespace {

constexpr std::uint32_t kMovesOfPage = 4096;
constexpr std::int64_t kDayNs = 86'400'000'000'000;

/// The list of which the source is a move: "arcs.csv move 12" is one of "arcs.csv".
std::optional<std::string> ListIn(std::string_view source) {
  constexpr std::string_view kMove = " move ";
  const std::size_t at = source.rfind(kMove);
  if (at == std::string_view::npos || at == 0) return std::nullopt;
  const std::string_view number = source.substr(at + kMove.size());
  std::int64_t move = 0;
  const auto read = std::from_chars(number.data(), number.data() + number.size(), move);
  if (read.ec != std::errc() || read.ptr != number.data() + number.size()) return std::nullopt;
  return std::string(source.substr(0, at));
}

/// Days from noon to noon UTC.
std::int64_t NightOf(WallTime at) { return (at.ns - kDayNs / 2) / kDayNs; }

void AddTo(std::vector<RecordedList>* lists, const std::string& name, bool is_night,
           const ConfigurationHistory& one) {
  lists->push_back({.name = name,
                    .is_night = is_night,
                    .first = one.row.id,
                    .last = one.row.id,
                    .configurations = 1,
                    .began = one.began});
}

/// The part of a unit's drive that a campaign has, beside its vectors.
struct DriveFacts {
  UnitDrive drive;
  bool is_tuned[kAxisCount] = {false, false};
};

std::map<std::uint32_t, DriveFacts> DrivesBySerial(const StoredFleet& fleet) {
  std::map<std::uint32_t, DriveFacts> drives;
  for (const VectorRow& row : fleet.vectors)
    for (std::size_t a = 0; a < kAxisCount; ++a)
      if (row.subdivision[a] > 0)
        drives[row.serial.value].drive.axis[a].subdivision = row.subdivision[a];
  for (const TuningRow& row : fleet.tunings) {
    DriveFacts& facts = drives[row.serial.value];
    facts.drive.v_bus_V = row.v_bus_V;
    facts.drive.axis[Index(row.axis)].counter1 = row.counter1;
    facts.drive.axis[Index(row.axis)].repeat = static_cast<std::uint8_t>(row.repeat);
    facts.is_tuned[Index(row.axis)] = true;
  }
  return drives;
}

/// A configuration with its last exposure.
struct Exposed {
  std::uint64_t configuration = 0;
  std::vector<MeasurementHistory> measured;
};

Result<std::vector<Exposed>> ExposuresOf(StoreReader* store, const RecordedList& list,
                                         std::size_t rows_max) {
  std::vector<Exposed> found;
  std::size_t rows = 0;
  for (std::uint64_t id = list.last; id >= std::max<std::uint64_t>(list.first, 1); --id) {
    FOCALFLEET_TRY_ASSIGN(const auto exposure, store->LastExposure(id));
    if (!exposure) continue;
    FOCALFLEET_TRY_ASSIGN(auto measured, store->Measurements(*exposure));
    rows += measured.size();
    if (rows > rows_max && !found.empty()) break;
    found.push_back({id, std::move(measured)});
  }
  std::ranges::reverse(found);
  return found;
}

/// Where the units stand, and how they came there, from configuration to configuration.
class Poses {
 public:
  struct Step {
    Pose from{};
    Pose to{};
    SerialNumber serial;
  };

  explicit Poses(StoreReader* store) : store_(store) {}

  /// Takes in what the configuration moved.
  Status Follow(std::uint64_t configuration) {
    // A unit that does not move again stands where its last move ended.
    for (auto& [unit, step] : steps_) step.from = step.to;
    for (std::uint64_t after = 0;;) {
      FOCALFLEET_TRY_ASSIGN(const ReplayPage page,
                            store_->Replay(configuration, after, kMovesOfPage));
      for (const MoveHistory& move : page.moves) {
        const bool arrived = move.end == IntentEnd::kArrived;
        if (arrived)
          steps_[move.unit.value] = {move.from, move.to, move.serial};
        else
          steps_.erase(move.unit.value);
      }
      if (!page.more) return {};
      after = page.moves.back().entry;
    }
  }

  [[nodiscard]] const Step* Find(UnitId unit) const {
    const auto step = steps_.find(unit.value);
    return step == steps_.end() ? nullptr : &step->second;
  }

 private:
  StoreReader* store_;
  std::map<std::uint32_t, Step> steps_;
};

LoggedMove RowOf(const MeasurementRow& measured, const Unit& unit, const Poses::Step& step,
                 const DriveFacts& facts) {
  const auto angles = [&](const Pose& pose) {
    return AxisAngles{AngleDeg(pose[0], unit.axis[0], facts.drive.axis[0]),
                      AngleDeg(pose[1], unit.axis[1], facts.drive.axis[1])};
  };
  const bool certain = IsCertain(measured.status);
  const bool tuned = facts.is_tuned[0] && facts.is_tuned[1];
  const double missing = std::nan("");
  return {.unit = unit.id,
          .move = static_cast<std::int64_t>(measured.configuration),
          .from = angles(step.from),
          .to = angles(step.to),
          .x_mm = certain ? measured.x_mm : missing,
          .y_mm = certain ? measured.y_mm : missing,
          .sigma_um = certain
                          ? 1e3 * std::sqrt((measured.covariance.xx + measured.covariance.yy) / 2)
                          : missing,
          .t_s = 0,
          .delay_s = measured.delay_s.value_or(missing),
          .v_bus_V = tuned ? facts.drive.v_bus_V : missing,
          .counter1 = tuned ? facts.drive.axis[0].counter1 : missing,
          .repeat = tuned ? facts.drive.axis[0].repeat : missing,
          .mode = "",
          .serial = step.serial};
}

}  // namespace

Result<std::vector<RecordedList>> RecordedLists(StoreReader* store,
                                                std::uint32_t configurations_max) {
  FOCALFLEET_TRY_ASSIGN(const auto configurations, store->Configurations(configurations_max));
  std::vector<RecordedList> lists;
  std::vector<RecordedList> nights;
  for (const ConfigurationHistory& one : configurations) {
    const auto extend = [&](std::vector<RecordedList>* of, const std::string& name, bool is_night,
                            bool goes_on) {
      if (!goes_on) return AddTo(of, name, is_night, one);
      of->back().first = one.row.id;
      of->back().began = one.began;
      ++of->back().configurations;
    };
    extend(&nights, "night", true,
           !nights.empty() && NightOf(nights.back().began) == NightOf(one.began));
    if (const auto name = ListIn(one.row.source))
      extend(&lists, *name, false,
             !lists.empty() && lists.back().name == *name && lists.back().first == one.row.id + 1);
  }
  lists.insert(lists.end(), nights.begin(), nights.end());
  return lists;
}

Result<sim::Campaign> RecordedCampaign(StoreReader* store, const Layout& layout,
                                       const RecordedList& list, std::size_t rows_max) {
  FOCALFLEET_TRY_ASSIGN(const StoredFleet fleet, store->Load());
  const std::map<std::uint32_t, DriveFacts> drives = DrivesBySerial(fleet);
  FOCALFLEET_TRY_ASSIGN(const std::vector<Exposed> exposures, ExposuresOf(store, list, rows_max));
  if (exposures.empty())
    return Fail(ErrorCode::kRefused, "none of these configurations was measured");
  CampaignLog log(&layout);
  Poses poses(store);
  const WallTime begin = exposures.front().measured.front().at;
  std::uint64_t next = exposures.front().configuration;
  for (const Exposed& exposed : exposures) {
    // Configurations that were not measured move units, too.
    for (; next <= exposed.configuration; ++next) FOCALFLEET_TRY(poses.Follow(next));
    std::vector<LoggedMove> rows;
    for (const MeasurementHistory& one : exposed.measured) {
      const auto place = layout.Find(one.row.unit);
      const Poses::Step* const step = poses.Find(one.row.unit);
      if (!place || step == nullptr || step->serial != one.row.serial) continue;
      const auto facts = drives.find(step->serial.value);
      rows.push_back(RowOf(one.row, layout.unit(*place), *step,
                           facts == drives.end() ? DriveFacts() : facts->second));
      rows.back().t_s = static_cast<double>(one.at.ns - begin.ns) * 1e-9;
    }
    log.Add(rows);
  }
  return log.Campaign(list.name);
}

}  // namespace focalfleet
