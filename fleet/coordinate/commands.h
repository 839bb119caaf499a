// A command is what an operator or a client asks of the coordinator. The request handler of the
// daemon makes commands from requests; Coordinator::Step takes them. A command names its request by
// a number, and its replies (effects.h) carry the same number.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "fleet/coordinate/sector_round.h"
#include "fleet/drive.h"
#include "fleet/measurement.h"
#include "fleet/records.h"
#include "protocol/base/ids.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// Starts a configuration: the units with targets go there.
struct ApplyCommand {
  std::string source;
  std::vector<std::optional<Pose>> targets;  // Shape: (n)
  bool fixed = false;
  /// Names of the targets, carried through to every report. Shape: (n), or empty: no names.
  std::vector<std::string> target_ids = {};
  /// With `measure`, an exposure follows when all units have arrived. Units that are farther off
  /// than the tolerance are sent again and measured again, at most `corrections` times.
  struct Measure {
    std::uint8_t corrections = 0;
    double tolerance_um = 10;
    /// With `observe`, findings are reported and stored, and not used: units go on by their own
    /// counts and without a unidirectional approach. Campaigns measure blind moves in this way.
    bool observe = false;
    bool operator==(const Measure&) const = default;
  };
  std::optional<Measure> measure = {};
  /// An offset is a model's prediction of a unit's place at its target, less the unit's own count
  /// there. Shape: (n), or empty: no model. A unit without an offset here keeps the one that it
  /// has.
  std::vector<std::optional<Pose>> offsets = {};
};
/// Gives one unit of the configuration under way another target; it need not have had one. A unit
/// that moves is stopped first. The reply comes when the unit starts, or says why it does not.
struct RetargetCommand {
  PositionerIndex unit;
  Pose target{};
};
struct StopCommand {
  std::optional<PositionerIndex> unit;  // none: all
};
/// Measures all units once, by camera or by their own sensors; no unit moves. Units of unknown
/// place are put where they are found. Targets of the configuration before stay, so that errors can
/// be reported.
struct MeasureCommand {};
struct HomeCommand {
  std::vector<PositionerIndex> units;
  bool unproven = false;  // homes also where a neighbour may be in the way: the operator's risk
};
struct EnableCommand {
  std::vector<PositionerIndex> units;
  bool enabled = true;
  std::string reason;
};
/// Binds the serial number that answers at this place to it.
struct AdoptCommand {
  PositionerIndex unit;
};
struct WriteParameterCommand {
  PositionerIndex unit;
  Axis axis = Axis::kTheta;
  Parameter parameter = Parameter::kRepeat;
  std::int32_t value = 0;
};
/// In a sector of a plane: the plane's coordinator starts a configuration. Units that cannot take
/// part fail with their reason; the others go on.
struct SectorTask {
  std::variant<ApplyCommand, HomeCommand, MeasureCommand> what;
};
/// In a sector of a plane: units of the configuration under way have other targets. A unit that
/// moves ends its move first; all go in the next round.
struct SectorRetargetCommand {
  struct Target {
    PositionerIndex unit;
    Pose pose{};
  };
  std::vector<Target> targets;
};
/// In a sector of a plane: what the plane's camera has found of its units; the answer to an
/// ExposureJob.
struct SectorFindings {
  std::uint64_t exposure = 0;
  Result<ExposureFindings> findings;
};
/// Stores what the shell has changed already, and answers `text` when that is durable.
struct KeepRowsCommand {
  std::vector<Row> rows;
  std::string text = "done";
};
struct Command {
  std::uint64_t request = 0;
  std::variant<ApplyCommand, RetargetCommand, StopCommand, HomeCommand, MeasureCommand,
               EnableCommand, AdoptCommand, WriteParameterCommand, KeepRowsCommand, SectorTask,
               SectorRound, SectorStartCommand, SectorWithdrawCommand, BorderEndCommand,
               SectorRetargetCommand, SectorFindings>
      what;
};

}  // namespace focalfleet
