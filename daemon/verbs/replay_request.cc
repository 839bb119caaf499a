#include "daemon/verbs/replay_request.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "daemon/status/history_json.h"

namespace focalfleet {
namespace {

constexpr std::uint32_t kReplayAlarmsMax = 200;
/// The last write of a configuration may come before the last alarm about it.
constexpr std::int64_t kAlarmsAfterNs = 10'000'000'000;

double SecondsBetween(WallTime from, WallTime to) {
  return std::round(static_cast<double>(to.ns - from.ns) * 1e-6) * 1e-3;
}

/// To 0.001 degrees, which is 0.2 um at an arm of 12 mm, and half the bytes.
Json DirectionDeg(double vectors, const AxisGeometry& axis, const AxisDrive& drive) {
  const double deg = axis.zero_deg + vectors * DegreesPerVector(axis, drive);
  return std::isfinite(deg) ? Json(std::round(deg * 1000) / 1000) : Json();
}

/// Where an axis was known to be; no number where it was not known at all.
double MiddleOf(const AxisKnowledge& known) {
  if (known.witness == Witness::kUnknown) return std::nan("");
  return (static_cast<double>(known.low) + static_cast<double>(known.high)) / 2;
}

/// The moves as columns of equal length.
class MoveColumns {
 public:
  MoveColumns(const Layout* layout, const std::vector<UnitDrive>* drives, WallTime began)
      : layout_(layout), drives_(drives), began_(began) {
    for (const char* name :
         {"unit_id", "round_began_s", "ended_s", "end", "theta_from_deg", "phi_from_deg",
          "theta_to_deg", "phi_to_deg", "theta_end_deg", "phi_end_deg", "witness"})
      columns_[name] = Json::array();
  }

  void Add(const MoveHistory& move) {
    const auto place = layout_->Find(move.unit);
    if (!place) {
      ++unknown_;
      return;
    }
    const Unit& unit = layout_->unit(*place);
    const UnitDrive& drive = (*drives_)[place->value];
    Put("unit_id", move.unit.value);
    Put("round_began_s", SecondsBetween(began_, move.began));
    Put("ended_s", move.ended ? Json(SecondsBetween(began_, *move.ended)) : Json());
    Put("end", move.end ? Name(*move.end) : "open");
    for (const Axis axis : kAxes) {
      const std::size_t a = Index(axis);
      const std::string name = Name(axis);
      const auto direction = [&](double vectors) {
        return DirectionDeg(vectors, unit.axis[a], drive.axis[a]);
      };
      Put(name + "_from_deg", direction(move.from[a]));
      Put(name + "_to_deg", direction(move.to[a]));
      Put(name + "_end_deg", move.ended_at ? direction(MiddleOf((*move.ended_at)[a])) : Json());
    }
    Put("witness",
        move.ended_at
            ? Json(Name(std::min((*move.ended_at)[0].witness, (*move.ended_at)[1].witness)))
            : Json());
  }

  [[nodiscard]] Json Take() { return std::move(columns_); }
  [[nodiscard]] std::uint32_t unknown() const { return unknown_; }

 private:
  void Put(const std::string& name, Json value) { columns_[name].push_back(std::move(value)); }

  const Layout* layout_;
  const std::vector<UnitDrive>* drives_;
  WallTime began_;
  Json columns_;
  std::uint32_t unknown_ = 0;
};

Json ErrorColumns(const ReplayPage& page) {
  Json units = Json::array();
  Json errors = Json::array();
  for (const MeasuredError& measured : page.errors) {
    units.push_back(measured.unit.value);
    errors.push_back(Number(measured.error_um));
  }
  return {
      {"exposure", page.exposure}, {"unit_id", std::move(units)}, {"error_um", std::move(errors)}};
}

Result<Json> AlarmsOf(const ConfigurationHistory& configuration, StoreReader* store) {
  Period period{.since = configuration.began, .until = configuration.changed};
  period.until.ns += kAlarmsAfterNs;
  FOCALFLEET_TRY_ASSIGN(const auto alarms, store->Alarms(kReplayAlarmsMax, period));
  return HistoryJson(alarms);
}

}  // namespace

Result<StoreReading> AskReplay(const ControlRequest& request, const FleetView& view) {
  FOCALFLEET_TRY_ASSIGN(const std::uint64_t id, UnsignedArgument(request.args, "configuration"));
  FOCALFLEET_TRY_ASSIGN(const std::uint64_t after, UnsignedArgumentOr(request.args, "after", 0));
  FOCALFLEET_TRY_ASSIGN(const std::uint64_t asked,
                        UnsignedArgumentOr(request.args, "limit", kReplayMovesMax));
  constexpr auto kMost = static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max() - 1);
  if (id > kMost || after > kMost)
    return Fail(ErrorCode::kInvalid, "there is no such configuration, or no such move");
  if (asked == 0) return Fail(ErrorCode::kInvalid, "limit must be 1 or more");
  const auto limit = static_cast<std::uint32_t>(std::min(asked, std::uint64_t{kReplayMovesMax}));
  const Layout* const layout = view.layout;
  const auto now = view.coordinator->drives();
  std::vector<UnitDrive> drives(now.begin(), now.end());
  return StoreReading(
      [id, after, limit, layout, drives = std::move(drives)](StoreReader* store) -> Result<Json> {
        FOCALFLEET_TRY_ASSIGN(ReplayPage page, store->Replay(id, after, limit));
        if (!page.configuration)
          return Fail(ErrorCode::kRefused, "the store has no configuration " + std::to_string(id));
        MoveColumns columns(layout, &drives, page.configuration->began);
        for (const MoveHistory& move : page.moves) columns.Add(move);
        Json answer = {{"moves", columns.Take()},
                       {"moves_of_gone_units", columns.unknown()},
                       {"next", page.more ? Json(page.moves.back().entry) : Json()}};
        if (after != 0) return answer;
        answer["configuration"] = HistoryJson(std::vector{*page.configuration}).front();
        answer["errors"] = ErrorColumns(page);
        FOCALFLEET_TRY_ASSIGN(answer["alarms"], AlarmsOf(*page.configuration, store));
        return answer;
      });
}

}  // namespace focalfleet
