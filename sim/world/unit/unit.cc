#include "sim/world/unit/unit.h"

#include <algorithm>

namespace focalfleet::sim {
namespace {
// Ids repeat after 65536 moves; long before that the record starts anew.
constexpr std::size_t kBegunMax = 32'768;

Firmware::Hardware::Joint JointOf(const Unit::Parts& parts, const Mechanism& mechanism) {
  if (parts.magnets == nullptr) return {};
  return {parts.description.id, parts.description.sensors, parts.description.fibre_carrier_mm,
          &mechanism, parts.magnets};
}
}  // namespace

Unit::Unit(const Parts& parts)
    : traits_(parts.traits),
      flash_(parts.flash),
      axis_(parts.axis),
      firmware_({parts.description.node,
                 parts.traits.clock,
                 &flash_,
                 {&axis_[0], &axis_[1]},
                 &faults_,
                 JointOf(parts, traits_.mechanism)}),
      recorded_(flash_.moves_begun),
      last_begun_(flash_.last_begun) {
  if (flash_.last_begun.value != 0) begun_.push_back(flash_.last_begun.value);
}

void Unit::OnFrame(const CanFrame& frame, HostInstant now, TransmitQueue* out) {
  firmware_.OnFrame(frame, now, out);
  RecordBegun(now);
}

void Unit::OnTime(HostInstant now, TransmitQueue* out) {
  firmware_.OnTime(now, out);
  RecordBegun(now);
}

void Unit::OnSync(HostInstant now, TransmitQueue* out) {
  firmware_.OnSync(now, out);
  RecordBegun(now);
}

void Unit::SpoilFlash(FlashDamage damage) {
  constexpr std::int32_t kEarlierVectors = 1000;
  if (damage == FlashDamage::kNoMark) flash_.moving = false;
  if (damage != FlashDamage::kOldCounts) return;
  // An older copy has the move of then, too.
  for (AxisFlash& axis : flash_.axis) axis.set_position(axis.position() - kEarlierVectors);
  flash_.last_begun = {};
  flash_.moving = false;
}

void Unit::RecordBegun(HostInstant now) {
  if (recorded_ == flash_.moves_begun) return;
  recorded_ = flash_.moves_begun;
  began_ = now;
  last_begun_ = flash_.last_begun;
  if (begun_.size() >= kBegunMax) begun_.clear();
  const std::uint16_t move = flash_.last_begun.value;
  const auto at = std::lower_bound(begun_.begin(), begun_.end(), move);
  if (at != begun_.end() && *at == move) {
    ++begun_twice_;
  } else {
    begun_.insert(at, move);
  }
}

}  // namespace focalfleet::sim
