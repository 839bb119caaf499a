#include "daemon/soak/fault_injector.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

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
bool IsOfOperators(FaultSite site) { return site >= kOperatorBusy && site <= kOperatorGone; }
bool IsOfCamera(FaultSite site) { return site >= kCameraDead && site <= kCameraOtherField; }

/// Limits of how long a fault lasts.
constexpr double kLastsMinS = 0.3, kLastsMaxS = 15;

}  // namespace

FaultInjector::FaultInjector(const Parts& parts, HostInstant now)
    : parts_(parts), now_(now), rng_(Rng::Stream(parts.draws->seed, "soak faults")) {
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

void FaultInjector::Sent(BusId bus, const CanFrame& frame) {
  if (healed_ || !is_on(kOldAnswers)) return;
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
      Count(site);
      parts_.host(site);
      return;
    case kDiskWriteError:
    case kDiskSyncError:
    case kDiskReadError:
    case kOldAnswers:
      return lasting();  // counted where an operation fails, or an old answer is heard
    case kDiskDropsPages:
      parts_.disk->drops_failed_syncs = true;
      on_[Index(kDiskDropsPages)] = true;
      Until(Lasts(), [this] {
        parts_.disk->drops_failed_syncs = false;
        on_[Index(kDiskDropsPages)] = false;
      });
      return;
    case kDiskFull:
      Count(site);
      parts_.disk->bytes_max = parts_.disk->bytes();
      return Until(Lasts(), [this] { parts_.disk->bytes_max = SIZE_MAX; });
    case kDiskSlow:
      Count(site);
      return lasting();
    case kForeignFrame:
    case kGarbageHeard:
      Count(site);
      return Hear(site == kGarbageHeard);
    default:
      break;
  }
  auto begun = BeginOnBus(site);
  if (!begun) begun = BeginOnUnit(site);
  if (!begun) return;
  Count(site);
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
    parts_.plant->heard(bus)->push_back({buses[bus], now_, frame});
    return;
  }
  const auto& units = parts_.plant->layout().units();
  const Unit& unit = units[rng_.Below(units.size())];
  frame =
      Encode(HostMessage(StatusRequest{}), {unit.node, static_cast<std::uint8_t>(rng_.Below(256))});
  parts_.plant->world().Inject(unit.bus, frame, now_, 1);
}

std::optional<FaultInjector::Begun> FaultInjector::BeginOnBus(FaultSite site) {
  auto disturb = parts_.plant->world().disturb();
  const auto buses = parts_.plant->layout().buses();
  const std::size_t index = rng_.Below(buses.size());
  const BusId bus = buses[index];
  HostInstant end = Lasts();
  sim::BusFaults* faults = disturb.faults(bus);
  const auto touch = [&](std::size_t which, HostInstant until) {
    Troubles::Until(until + Seconds(3), &parts_.troubles->buses[which]);
  };
  switch (site) {
    case kBusNoise:
      faults->bit_error_rate = std::exp(rng_.Uniform(std::log(1e-6), std::log(3e-3)));
      Until(end, [faults] { faults->bit_error_rate = 0; });
      break;
    case kBusDrop:
      faults->drop = rng_.Uniform(0.01, 0.6);
      Until(end, [faults] { faults->drop = 0; });
      break;
    case kBusDuplicate:
      faults->duplicate = rng_.Uniform(0.01, 0.5);
      Until(end, [faults] { faults->duplicate = 0; });
      break;
    case kBusDelay:
      faults->late = rng_.Uniform(0.05, 0.8);
      faults->late_by = Milliseconds(1 + static_cast<std::int64_t>(rng_.Below(400)));
      Until(end, [faults] { faults->late = 0; });
      break;
    case kBusDead:
      disturb.KillBus(bus);
      Until(end, [this, bus] { parts_.plant->world().disturb().ReviveBus(bus); });
      break;
    case kBusSwizzle:
      // Buses stop one by one, and come back in another order.
      for (std::size_t which = 0; which < buses.size(); ++which) {
        const BusId each = buses[which];
        const HostInstant begins = now_ + Milliseconds(static_cast<std::int64_t>(rng_.Below(2000)));
        end = begins + Milliseconds(200 + static_cast<std::int64_t>(rng_.Below(8000)));
        Until(begins, [this, each] {
          if (!healed_) parts_.plant->world().disturb().KillBus(each);
        });
        Until(end, [this, each] { parts_.plant->world().disturb().ReviveBus(each); });
        touch(which, end);
      }
      return Begun{"all buses", end};
    case kBusStuck:
      disturb.StickBus(bus);
      Until(end, [this, bus] { parts_.plant->world().disturb().ReleaseBus(bus); });
      break;
    case kBusHostOff:
      disturb.ThrowHostOff(bus);
      end = now_ + Seconds(3);
      break;
    case kForeignStop:
      parts_.plant->world().Inject(
          bus,
          Encode(HostMessage(Stop{}), {kBroadcastNode, static_cast<std::uint8_t>(rng_.Below(256))}),
          now_, 1);
      break;
    default:
      return std::nullopt;
  }
  touch(index, end);
  return Begun{fmt::format("bus {}", bus.value), end};
}

std::optional<FaultInjector::Begun> FaultInjector::BeginOnUnit(FaultSite site) {
  auto disturb = parts_.plant->world().disturb();
  const auto& units = parts_.plant->layout().units();
  const std::size_t row = rng_.Below(units.size());
  const UnitId unit = units[row].id;
  const HostInstant end = Lasts();
  const Begun begun{fmt::format("unit {}", unit.value), end};
  const auto power_cut = [&](std::size_t which) {
    const UnitId each = units[which].id;
    disturb.PowerCut(each);
    parts_.troubles->jumps[which].push_back(now_);
    Until(end, [this, each] { parts_.plant->world().disturb().PowerOn(each); });
  };
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
      disturb.RaiseFault(unit, static_cast<FaultCode>(1 + rng_.Below(5)),
                         rng_.Below(2) == 0 ? Axis::kTheta : Axis::kPhi);
      return begun;
    case kUnitUnplugged:
      disturb.Unplug(unit);
      deaf(row);
      Until(end, [this, unit] { parts_.plant->world().disturb().Plug(unit); });
      return begun;
    case kUnitBabbles: {
      // A babbler takes its whole bus.
      CanFrame frame{};
      frame.id = static_cast<std::uint32_t>(rng_.Below(8)) << 26 | 1u << 19 |
                 static_cast<std::uint32_t>(units[row].node.value) << 11;
      disturb.Babble(unit, frame);
      const auto buses = parts_.plant->layout().buses();
      const auto bus = std::lower_bound(buses.begin(), buses.end(), units[row].bus) - buses.begin();
      Troubles::Until(end + Seconds(3), &parts_.troubles->buses[static_cast<std::size_t>(bus)]);
      Until(end, [this, unit] { parts_.plant->world().disturb().Babble(unit, std::nullopt); });
      return begun;
    }
    case kUnitFlashLost:
    case kUnitMarkLost:
      // FLASH shows its damage when the unit starts anew.
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
  BeginWrongAnswers(site, unit);
  // Hardware is exchanged while it has no power.
  const bool exchanged = site == kUnitForeign || site == kUnitSerialZero;
  const auto power_cycle = [this, unit, row, exchanged] {
    if (!exchanged) return;
    parts_.troubles->jumps[row].push_back(now_);
    parts_.plant->world().disturb().PowerCut(unit);
    parts_.plant->world().disturb().PowerOn(unit);
  };
  power_cycle();
  Until(end, [faults, power_cycle] {
    *faults = {};
    power_cycle();
  });
  return begun;
}

void FaultInjector::BeginWrongAnswers(FaultSite site, UnitId unit) {
  sim::UnitFaults* faults = parts_.plant->world().disturb().faults(unit);
  constexpr Function kIgnored[] = {Function::kConfirm, Function::kArm,    Function::kStageBegin,
                                   Function::kStatus,  Function::kVector, Function::kProgress,
                                   Function::kHome,    Function::kClock};
  constexpr Function kRefused[] = {Function::kConfirm, Function::kArm, Function::kHome,
                                   Function::kParameterWrite};
  switch (site) {
    case kUnitSilent:
      faults->silent = true;
      break;
    case kUnitDeaf:
      faults->deaf = true;
      break;
    case kUnitLate:
      faults->late = Milliseconds(1 + static_cast<std::int64_t>(rng_.Below(3000)));
      break;
    case kUnitCopies:
      faults->copies = static_cast<std::uint8_t>(2 + rng_.Below(4));
      break;
    case kUnitWrongDigest:
      faults->wrong_digest = true;
      break;
    case kUnitMuteDone:
      faults->mute_done = true;
      break;
    case kUnitIgnores:
      faults->ignores = kIgnored[rng_.Below(std::size(kIgnored))];
      break;
    case kUnitRefuses:
      faults->refuses = {kRefused[rng_.Below(std::size(kRefused))],
                         static_cast<Answer>(1 + rng_.Below(7))};
      break;
    case kUnitStaleSequence:
      faults->stale_sequence = true;
      break;
    case kUnitFaultInMotion:
      faults->in_motion = {Milliseconds(static_cast<std::int64_t>(rng_.Below(6000))),
                           static_cast<FaultCode>(1 + rng_.Below(5)),
                           rng_.Below(2) == 0 ? Axis::kTheta : Axis::kPhi};
      break;
    case kUnitForeign:
      faults->foreign_serial = SerialNumber{900'000 + unit.value};
      break;
    case kUnitSerialZero:
      faults->foreign_serial = SerialNumber{0};
      break;
    default:
      break;
  }
}

int FaultInjector::Disk(DiskOperation operation) {
  const auto fails = [&](FaultSite site, double chance, int code) {
    if (!is_on(site) || rng_.Uniform() >= chance) return SQLITE_OK;
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
      if (is_on(kDiskDropsPages)) return fails(kDiskDropsPages, kOften, SQLITE_IOERR_FSYNC);
      return fails(kDiskSyncError, kOften, SQLITE_IOERR_FSYNC);
    case DiskOperation::kOpen:
      return SQLITE_OK;
  }
  return SQLITE_OK;
}

}  // namespace focalfleet::soak
