#include "daemon/soak/fault_injector.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "daemon/soak/answer_faults.h"
#include "daemon/soak/virtual_time.h"
#include "protocol/wire/codec.h"

namespace focalfleet::soak {
namespace {

using enum FaultSite;

/// Sites that go by occasions; all others go by time.
bool IsByOccasion(FaultSite site) {
  return site <= kKillInStart || site == kPortFull || site == kPlannerSlow ||
         site == kPlannerFails || site == kPlannerFull || site == kReaderBehind ||
         site == kStoreReaderFails;
}
bool IsOfOperators(FaultSite site) {
  return (site >= kOperatorBusy && site <= kOperatorGone) || site == kOperatorModel;
}
bool IsOfCamera(FaultSite site) { return site >= kCameraDead && site <= kCameraOtherField; }

/// Limits of how long a fault lasts.
constexpr double kLastsMinS = 0.3, kLastsMaxS = 15;

}  // namespace

FaultInjector::FaultInjector(const Parts& parts, HostInstant now)
    : parts_(parts),
      now_(now),
      rng_(Rng::Stream(parts.draws->seed, "soak faults")),
      unplugged_(parts.plant->layout().size()) {
  parts_.disk->was_full = [this] { Count(kDiskFull); };
  for (std::size_t n = 0; n < kFaultSites; ++n) {
    const auto site = static_cast<FaultSite>(n);
    const bool timed =
        parts_.draws->armed[n] && !IsByOccasion(site) && !IsOfOperators(site) && !IsOfCamera(site);
    due_[n] = timed ? now + Gap(site) : kNever;
  }
}

DurationNs FaultInjector::Gap(FaultSite site) {
  const double mean_ns = static_cast<double>(parts_.draws->period[Index(site)].ns);
  return DurationNs{1 + static_cast<std::int64_t>(-mean_ns * std::log(1 - rng_.Uniform()))};
}

HostInstant FaultInjector::Lasts() {
  return now_ + Seconds(kLastsMinS * std::exp(rng_.Uniform() * std::log(kLastsMaxS / kLastsMinS)));
}

HostInstant FaultInjector::next() const {
  HostInstant at = ends_.empty() ? kNever : ends_.top().at;
  if (!healed_) at = std::min(at, *std::ranges::min_element(due_));
  return at;
}

void FaultInjector::Apply(HostInstant now) {
  now_ = now;
  while (!ends_.empty() && ends_.top().at <= now) {
    const auto undo = ends_.top().undo;
    ends_.pop();
    undo();
  }
  for (std::size_t n = 0; n < kFaultSites && !healed_; ++n) {
    if (due_[n] > now) continue;
    due_[n] = now + Gap(static_cast<FaultSite>(n));
    Begin(static_cast<FaultSite>(n));
  }
}

bool FaultInjector::Happens(FaultSite site, double more) {
  if (healed_ || !parts_.draws->is(site)) return false;
  if (rng_.Uniform() >= more * parts_.draws->chance[Index(site)]) return false;
  Count(site);
  return true;
}

bool FaultInjector::Acts(FaultSite site) {
  if (!on_[Index(site)]) return false;
  Count(site);
  return true;
}

void FaultInjector::Sent(BusId bus, const CanFrame& frame) {
  const auto units = parts_.plant->layout().units();
  const std::uint32_t node = frame.id >> 11 & 0xff;
  for (std::size_t row = 0; row < unplugged_.size(); ++row)
    if (unplugged_[row] && units[row].bus == bus &&
        (node == units[row].node.value || node == kBroadcastNode.value))
      Count(kUnitUnplugged);
  if (healed_ || !on_[Index(kOldAnswers)]) return;
  const auto buses = parts_.plant->layout().buses();
  const auto index =
      static_cast<std::size_t>(std::lower_bound(buses.begin(), buses.end(), bus) - buses.begin());
  const auto old = parts_.plant->AnsweredBefore(index, frame);
  if (!old) return;
  Count(kOldAnswers);
  parts_.plant->heard(index)->push_back({bus, HostInstant{ReadVirtualNs()}, *old});
}

void FaultInjector::Until(HostInstant at, std::function<void()> undo) {
  ends_.push({at, ends_number_++, std::move(undo)});
}

void FaultInjector::Heal(HostInstant now) {
  now_ = now;
  healed_ = true;
  while (!ends_.empty()) {
    const auto undo = ends_.top().undo;
    ends_.pop();
    undo();
  }
  parts_.disk->bytes_max = SIZE_MAX;
  parts_.disk->drops_failed_syncs = false;
}

void FaultInjector::Begin(FaultSite site) {
  const auto lasting = [&] {
    const HostInstant end = Lasts();
    if (std::exchange(on_[Index(site)], true)) return;
    Until(end, [this, site] { on_[Index(site)] = false; });
  };
  switch (site) {
    case kHostPowerCut:
    case kHostEnds:
    case kHostFreeze:
    case kWallStepBack:
    case kWallStepForward:
      if (parts_.host(site)) Count(site);
      return;
    case kDiskWriteError:
    case kDiskSyncError:
    case kDiskReadError:
    case kDiskSlow:
    case kOldAnswers:
      return lasting();
    case kDiskDropsPages:
      parts_.disk->drops_failed_syncs = true;
      on_[Index(kDiskDropsPages)] = true;
      Until(Lasts(), [this] {
        parts_.disk->drops_failed_syncs = false;
        on_[Index(kDiskDropsPages)] = false;
      });
      return;
    case kDiskFull:
      parts_.disk->bytes_max = parts_.disk->bytes();
      return Until(Lasts(), [this] { parts_.disk->bytes_max = SIZE_MAX; });
    case kForeignFrame:
    case kGarbageHeard:
      return Hear(site == kGarbageHeard);
    default:
      break;
  }
  auto begun = BeginOnBus(site);
  if (!begun) begun = BeginOnUnit(site);
  if (!begun) return;
  parts_.tell(fmt::format("{} on {}, {:.1f} s", Name(site), begun->on,
                          1e-9 * static_cast<double>((begun->until - now_).ns)));
}

/// A frame that no host of ours sent, or that no unit sent.
void FaultInjector::Hear(bool garbage) {
  const auto buses = parts_.plant->layout().buses();
  const std::size_t bus = rng_.Below(buses.size());
  CanFrame frame{};
  if (garbage) {
    frame.id = static_cast<std::uint32_t>(rng_.Below(1u << 29)) | 1u << 19;  // as from a unit
    frame.length = static_cast<std::uint8_t>(rng_.Below(9));
    for (std::size_t k = 0; k < frame.length; ++k)
      frame.data[k] = static_cast<std::uint8_t>(rng_.Below(256));
    // A report that decodes by chance and speaks for a unit is a lie that no host can tell; such
    // frames get a node that nobody has.
    frame.id |= 0xffu << 11;
    if (parts_.daemon_lives()) Count(kGarbageHeard);
    parts_.plant->heard(bus)->push_back({buses[bus], now_, frame});
    return;
  }
  const auto& units = parts_.plant->layout().units();
  const Unit& unit = units[rng_.Below(units.size())];
  frame =
      Encode(HostMessage(StatusRequest{}), {unit.node, static_cast<std::uint8_t>(rng_.Below(256))});
  if (parts_.plant->world().Inject(unit.bus, frame, now_, 1)) Count(kForeignFrame);
}

std::optional<FaultInjector::Begun> FaultInjector::BeginOnBus(FaultSite site) {
  auto disturb = parts_.plant->world().disturb();
  const auto buses = parts_.plant->layout().buses();
  const std::size_t index = rng_.Below(buses.size());
  const BusId bus = buses[index];
  const auto touch = [&](std::size_t which, HostInstant until) {
    Troubles::Until(until + Seconds(3), &parts_.troubles->buses[which]);
  };
  HostInstant end = Lasts();
  if (BeginOfFrames(site, bus, end)) {
    touch(index, end);
    return Begun{fmt::format("bus {}", bus.value), end};
  }
  // The state of a link changes at once, for a daemon that is there to see it.
  const auto count = [this, site] {
    if (parts_.daemon_lives()) Count(site);
  };
  switch (site) {
    case kBusDead:
      count();
      disturb.KillBus(bus);
      Until(end, [this, bus] { parts_.plant->world().disturb().ReviveBus(bus); });
      break;
    case kBusSwizzle:
      // Buses stop one by one, and come back in another order.
      for (std::size_t which = 0; which < buses.size(); ++which) {
        const BusId each = buses[which];
        const HostInstant begins = now_ + Milliseconds(static_cast<std::int64_t>(rng_.Below(2000)));
        end = begins + Milliseconds(200 + static_cast<std::int64_t>(rng_.Below(8000)));
        Until(begins, [this, each, count] {
          if (healed_) return;
          count();
          parts_.plant->world().disturb().KillBus(each);
        });
        Until(end, [this, each] { parts_.plant->world().disturb().ReviveBus(each); });
        touch(which, end);
      }
      return Begun{"all buses", end};
    case kBusStuck:
      count();
      disturb.StickBus(bus);
      Until(end, [this, bus] { parts_.plant->world().disturb().ReleaseBus(bus); });
      break;
    case kBusHostOff:
      count();
      disturb.ThrowHostOff(bus);
      end = now_ + Seconds(3);
      break;
    case kForeignStop:
      if (parts_.plant->world().Inject(
              bus,
              Encode(HostMessage(Stop{}),
                     {kBroadcastNode, static_cast<std::uint8_t>(rng_.Below(256))}),
              now_, 1))
        Count(site);
      break;
    default:
      return std::nullopt;
  }
  touch(index, end);
  return Begun{fmt::format("bus {}", bus.value), end};
}

bool FaultInjector::BeginOfFrames(FaultSite site, BusId bus, HostInstant end) {
  sim::BusFaults* faults = parts_.plant->world().disturb().faults(bus);
  std::uint32_t sim::BusFaults::Acted::*acted = nullptr;
  double sim::BusFaults::*chance = nullptr;
  switch (site) {
    case kBusNoise:
      faults->bit_error_rate = std::exp(rng_.Uniform(std::log(1e-6), std::log(3e-3)));
      acted = &sim::BusFaults::Acted::noise;
      chance = &sim::BusFaults::bit_error_rate;
      break;
    case kBusDrop:
      faults->drop = rng_.Uniform(0.01, 0.6);
      acted = &sim::BusFaults::Acted::drop;
      chance = &sim::BusFaults::drop;
      break;
    case kBusDuplicate:
      faults->duplicate = rng_.Uniform(0.01, 0.5);
      acted = &sim::BusFaults::Acted::duplicate;
      chance = &sim::BusFaults::duplicate;
      break;
    case kBusDelay:
      faults->late = rng_.Uniform(0.05, 0.8);
      faults->late_by = Milliseconds(1 + static_cast<std::int64_t>(rng_.Below(400)));
      acted = &sim::BusFaults::Acted::late;
      chance = &sim::BusFaults::late;
      break;
    default:
      return false;
  }
  Until(end, [this, site, faults, acted, chance] {
    faults->*chance = 0;
    Count(site, std::exchange(faults->acted.*acted, 0u));
  });
  return true;
}

std::optional<FaultInjector::Begun> FaultInjector::BeginOnUnit(FaultSite site) {
  auto disturb = parts_.plant->world().disturb();
  const auto& units = parts_.plant->layout().units();
  const std::size_t row = rng_.Below(units.size());
  const UnitId unit = units[row].id;
  const HostInstant end = Lasts();
  const Begun begun{fmt::format("unit {}", unit.value), end};
  const auto power_cut = [&](std::size_t which) { CutPower(site, which, end); };
  const auto deaf = [&](std::size_t which) {
    Troubles::Until(end + Seconds(3), &parts_.troubles->deaf[which]);
  };
  Troubles::Until(end + Seconds(3), &parts_.troubles->units[row]);
  switch (site) {
    case kUnitPowerCut:
      power_cut(row);
      return begun;
    case kRailPowerCut:
      for (std::size_t which = 0; which < units.size(); ++which)
        if (units[which].rail == units[row].rail) power_cut(which);
      return begun;
    case kUnitFault:
      if (parts_.plant->world().Truth(row).powered) Count(site);
      disturb.RaiseFault(unit, static_cast<FaultCode>(1 + rng_.Below(5)),
                         rng_.Below(2) == 0 ? Axis::kTheta : Axis::kPhi);
      return begun;
    case kUnitUnplugged:
      disturb.Unplug(unit);
      unplugged_[row] = true;
      deaf(row);
      Until(end, [this, unit, row] {
        parts_.plant->world().disturb().Plug(unit);
        unplugged_[row] = false;
      });
      return begun;
    case kUnitBabbles: {
      // A babbler takes its whole bus.
      CanFrame frame{};
      frame.id = static_cast<std::uint32_t>(rng_.Below(8)) << 26 | 1u << 19 |
                 static_cast<std::uint32_t>(units[row].node.value) << 11;
      if (parts_.plant->world().Truth(row).powered) Count(site);
      disturb.Babble(unit, frame);
      const auto buses = parts_.plant->layout().buses();
      const auto bus = std::lower_bound(buses.begin(), buses.end(), units[row].bus) - buses.begin();
      Troubles::Until(end + Seconds(3), &parts_.troubles->buses[static_cast<std::size_t>(bus)]);
      Until(end, [this, unit] { parts_.plant->world().disturb().Babble(unit, std::nullopt); });
      return begun;
    }
    case kUnitFlashLost:
    case kUnitMarkLost:
      power_cut(row);
      if (site == kUnitFlashLost && parts_.troubles->counts_lost[row] == Troubles::kLongAgo)
        parts_.troubles->counts_lost[row] = now_;
      disturb.SpoilFlash(
          unit, site == kUnitFlashLost ? sim::FlashDamage::kOldCounts : sim::FlashDamage::kNoMark);
      return begun;
    case kUnitIntermittent:
      for (int part = 0; part < 8; ++part) {
        const HostInstant at = now_ + Milliseconds(300 * part);
        Until(at, [this, unit, part] {
          CountAnswers(kUnitIntermittent, unit);
          parts_.plant->world().disturb().faults(unit)->silent = !healed_ && part % 2 == 0;
        });
      }
      return begun;
    default:
      break;
  }
  sim::UnitFaults* faults = disturb.faults(unit);
  if (site == kUnitDeaf || site == kUnitIgnores) deaf(row);
  if (site < kUnitSilent || site > kUnitSerialZero) return std::nullopt;
  LetAnswerWrongly(site, unit, &rng_, faults);
  // Hardware is exchanged while it has no power.
  const bool exchanged = site == kUnitForeign || site == kUnitSerialZero;
  const auto power_cycle = [this, unit, row, exchanged] {
    if (!exchanged) return;
    parts_.troubles->jumps[row].push_back(now_);
    parts_.plant->world().disturb().PowerCut(unit);
    parts_.plant->world().disturb().PowerOn(unit);
  };
  power_cycle();
  Until(end, [this, site, unit, faults, power_cycle] {
    CountAnswers(site, unit);
    *faults = {};
    power_cycle();
  });
  return begun;
}

/// FLASH shows its damage when the unit starts anew; its mark is set in mid-move alone.
void FaultInjector::CutPower(FaultSite site, std::size_t row, HostInstant end) {
  const UnitId unit = parts_.plant->layout().units()[row].id;
  const sim::UnitTruth truth = parts_.plant->world().Truth(row);
  const bool marked = parts_.plant->world().flash(unit).moving;
  if (truth.powered && (site != kUnitMarkLost || marked)) Count(site);
  parts_.plant->world().disturb().PowerCut(unit);
  parts_.troubles->jumps[row].push_back(now_);
  Until(end, [this, unit] { parts_.plant->world().disturb().PowerOn(unit); });
}

/// Counts what of the unit's answers the fault has changed since the last count.
void FaultInjector::CountAnswers(FaultSite site, UnitId unit) {
  const auto kind = KindOf(site);
  if (!kind) return;
  sim::UnitFaults* faults = parts_.plant->world().disturb().faults(unit);
  Count(site, std::exchange(faults->acted[static_cast<std::size_t>(*kind)], 0u));
}

int FaultInjector::Disk(DiskOperation operation) {
  const auto fails = [&](FaultSite site, double chance, int code) {
    if (!on_[Index(site)] || rng_.Uniform() >= chance) return SQLITE_OK;
    Count(site);
    Troubles::Until(now_ + Seconds(3), &parts_.troubles->store);
    return code;
  };
  constexpr double kOften = 0.3;
  switch (operation) {
    case DiskOperation::kRead:
      return fails(kDiskReadError, 0.02, SQLITE_IOERR_READ);
    case DiskOperation::kWrite:
    case DiskOperation::kTruncate:
      return fails(kDiskWriteError, 0.1, SQLITE_IOERR_WRITE);
    case DiskOperation::kSync:
      if (on_[Index(kDiskDropsPages)]) return fails(kDiskDropsPages, kOften, SQLITE_IOERR_FSYNC);
      return fails(kDiskSyncError, kOften, SQLITE_IOERR_FSYNC);
    case DiskOperation::kOpen:
      return SQLITE_OK;
  }
  return SQLITE_OK;
}

}  // namespace focalfleet::soak
