#include "daemon/page/plan_motion.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "fleet/estimate.h"

namespace focalfleet {
namespace {

constexpr std::uint8_t kMotionFormat = 1;
constexpr double kRadiansPerDegree = M_PI / 180;

template <class Value>
void AddBytes(Value value, std::string* out) {
  const std::size_t at = out->size();
  out->resize(at + sizeof value);
  std::memcpy(out->data() + at, &value, sizeof value);
}
void AddReal(double value, std::string* out) { AddBytes(static_cast<float>(value), out); }

void AddRows(const UnitPlan& move, const Unit& unit, const UnitDrive& drive, std::string* out) {
  for (const Axis axis : kAxes) {
    const std::size_t a = Index(axis);
    for (const Segment& segment : move.path[a].segments()) {
      const SegmentTime time = TimeOf(segment, drive.axis[a]);
      AddReal(time.t0_s, out);
      AddReal(time.t1_s, out);
      AddReal(AngleDeg(segment.delta, unit.axis[a], drive.axis[a]) * kRadiansPerDegree, out);
    }
  }
}

}  // namespace

std::string EncodeMotion(const Plan& plan, const Layout& layout,
                         std::span<const UnitDrive> drives) {
  std::string out;
  double end_s = 0;
  for (const UnitPlan& move : plan.moves)
    end_s = std::max(end_s, EndOf(move, drives[move.unit.value]));
  AddBytes(std::uint32_t{0}, &out);
  AddBytes(std::uint32_t{kMotionFormat}, &out);
  AddBytes(static_cast<std::uint32_t>(plan.moves.size()), &out);
  AddReal(end_s, &out);
  for (const UnitPlan& move : plan.moves) {
    const Unit& unit = layout.unit(move.unit);
    const UnitDrive& drive = drives[move.unit.value];
    AddBytes(move.unit.value, &out);
    for (const Axis axis : kAxes) {
      const std::size_t a = Index(axis);
      const double deg =
          unit.axis[a].zero_deg + AngleDeg(move.from[a], unit.axis[a], drive.axis[a]);
      AddReal(deg * kRadiansPerDegree, &out);
    }
    AddBytes(move.path[0].size(), &out);
    AddBytes(move.path[1].size(), &out);
    AddBytes(std::uint16_t{0}, &out);
    AddRows(move, unit, drive, &out);
  }
  const auto length = static_cast<std::uint32_t>(out.size() - 4);
  std::memcpy(out.data(), &length, sizeof length);
  return out;
}

bool IsMotion(std::string_view bytes) {
  constexpr std::size_t kHeadBytes = 16, kUnitBytes = 16, kRowBytes = 12, kRowsAt = 12;
  const auto number = [&](std::size_t at) {
    std::uint32_t value = 0;
    std::memcpy(&value, bytes.data() + at, sizeof value);
    return value;
  };
  if (bytes.size() < kHeadBytes || number(0) != bytes.size() - 4 || number(4) != kMotionFormat)
    return false;
  std::size_t at = kHeadBytes;
  for (std::uint32_t unit = 0; unit < number(8); ++unit) {
    if (bytes.size() - at < kUnitBytes) return false;
    const std::size_t rows = static_cast<unsigned char>(bytes[at + kRowsAt]) +
                             std::size_t{static_cast<unsigned char>(bytes[at + kRowsAt + 1])};
    at += kUnitBytes;
    if (bytes.size() - at < rows * kRowBytes) return false;
    at += rows * kRowBytes;
  }
  return at == bytes.size();
}

}  // namespace focalfleet
