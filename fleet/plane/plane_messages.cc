#include "fleet/plane/plane_messages.h"

#include <cmath>
#include <cstdlib>

#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

bool IsKnowledge(const UnitKnowledge& known) {
  for (const AxisKnowledge& axis : known) {
    if (axis.witness > Witness::kMeasured) return false;
    if (axis.witness == Witness::kUnknown) continue;
    if (axis.low > axis.high ||
        std::abs(static_cast<std::int64_t>(axis.low)) > limits::kPositionMax ||
        std::abs(static_cast<std::int64_t>(axis.high)) > limits::kPositionMax)
      return false;
  }
  return true;
}

bool IsPose(const Pose& pose) {
  for (const std::int32_t vectors : pose)
    if (std::abs(static_cast<std::int64_t>(vectors)) > limits::kPositionMax) return false;
  return true;
}

bool IsDrive(const UnitDrive& drive) {
  for (const AxisDrive& axis : drive.axis)
    if (axis.counter1 == 0 || axis.repeat == 0 || axis.subdivision == 0) return false;
  return drive.mode <= WaveMode::kSevenSegment && std::isfinite(drive.v_bus_V);
}

}  // namespace

std::uint64_t DigestOf(const SectorPlaces& places) {
  std::uint64_t digest = 0xcbf29ce484222325u;
  const auto add = [&digest](std::int64_t word) {
    digest = (digest ^ static_cast<std::uint64_t>(word)) * 0x100000001b3u;
  };
  for (const UnitKnowledge& known : places.places)
    for (const AxisKnowledge& axis : known) {
      add(static_cast<std::int64_t>(axis.witness));
      add(axis.low);
      add(axis.high);
    }
  for (const UnitDrive& drive : places.drives)
    for (const AxisDrive& axis : drive.axis) {
      add(axis.counter1);
      add(axis.repeat);
      add(axis.subdivision);
    }
  return digest;
}

std::string FaultOf(const SectorPlaces& places, std::size_t units) {
  if (places.places.size() != units || places.drives.size() != units)
    return "they are for another number of units";
  for (std::size_t n = 0; n < units; ++n)
    if (!IsKnowledge(places.places[n]) || !IsDrive(places.drives[n]))
      return "one of them cannot be";
  return {};
}

std::string FaultOf(const SectorExposure& exposure, std::size_t units) {
  if (exposure.expected.size() != units || exposure.before.size() != units ||
      exposure.reported.size() != units || exposure.seen.size() != units ||
      exposure.wanted.size() != units || exposure.drives.size() != units)
    return "it is for another number of units";
  for (std::size_t n = 0; n < units; ++n)
    if (!IsKnowledge(exposure.expected[n]) || !IsDrive(exposure.drives[n]) ||
        (exposure.before[n] && !IsPose(*exposure.before[n])) ||
        (exposure.reported[n] && !IsPose(*exposure.reported[n])))
      return "it has a place or a drive that cannot be";
  if (!std::isfinite(exposure.tolerance_um)) return "its tolerance is no number";
  return {};
}

std::string FaultOf(const SectorJob& job, std::size_t units) {
  if (job.start.size() != units || job.targets.size() != units || job.frozen.size() != units ||
      job.offsets.size() != units || job.drives.size() != units)
    return "it is for another number of units";
  for (std::size_t n = 0; n < units; ++n)
    if (!IsKnowledge(job.start[n]) || (job.targets[n] && !IsPose(*job.targets[n])) ||
        !IsPose(job.offsets[n]) || !IsDrive(job.drives[n]))
      return "it has a place or a drive that cannot be";
  for (std::size_t n = 0; n < job.to_home.size(); ++n)
    if (job.to_home[n].value >= units || (n > 0 && !(job.to_home[n - 1] < job.to_home[n])))
      return "the units to home are not in order, or none of this sector";
  if (!(job.start_skew_s >= 0 && job.start_skew_s <= 1) ||
      !(job.notice_s >= 0 && job.notice_s <= 60))
    return "it allows for a skew or a notice that cannot be";
  return {};
}

}  // namespace focalfleet
