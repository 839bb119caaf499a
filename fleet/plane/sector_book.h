// The knowledge of the plane's coordinator of each sector, and the order that each one has. Reports
// come in, orders go out; an order is repeated until it is carried out, and afterwards as a sign of
// life.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "fleet/plane/plane_layout.h"
#include "fleet/plane/plane_messages.h"
#include "fleet/plane/sector_clock.h"

namespace focalfleet {

struct PlaneTimes {
  DurationNs listen = Milliseconds(1500);  // before an epoch is claimed
  /// A coordinator that gives no orders for so long may be replaced.
  DurationNs takeover = Milliseconds(5000);
  DurationNs repeat = Milliseconds(200);        // of orders
  DurationNs body_repeat = Milliseconds(1000);  // of an order with its body
  DurationNs silence = Milliseconds(3000);      // without a report: the sector is not heard
  /// A sector that is not ready in this time is left out of the round.
  DurationNs gather_patience = Milliseconds(5000);
  /// Where nothing else is left to do: for units that still move on after a kill of their daemon.
  DurationNs settle_patience = Milliseconds(200'000);
  DurationNs round_patience = Milliseconds(120'000);  // for upload, read-back, arming, intents
  /// From the order to the last moment in which a sector decides to start: ten words of the border
  /// pass in it.
  DurationNs confirm_window = Milliseconds(600);
  DurationNs finish_patience = Milliseconds(10'000);
  /// Two sectors' clocks may differ by this much; plans allow for it.
  DurationNs clock_allowance = Milliseconds(5);
  /// A clock that is known to less for so long is an alarm.
  DurationNs clock_patience = Milliseconds(3000);
  /// The news of an end takes this long to the next sector: SectorAgentConfig::suspicion, a word
  /// under way, and two turns of a host. Plans are made with it.
  DurationNs border_notice = Milliseconds(500);
};

class SectorBook {
 public:
  /// `plane` outlives this.
  SectorBook(const PlaneLayout* plane, const PlaneTimes& times);

  /// A sector as it was last heard.
  struct Entry {
    std::optional<SectorReport> report;  // without its body
    HostInstant heard{INT64_MIN};
    SectorClock clock;
    std::shared_ptr<const SectorJob> job;        // the last that came, of this life of the sector
    std::shared_ptr<const SectorPlaces> places;  // the last that came, of any life
    std::uint64_t places_digest = 0;
    std::shared_ptr<const SectorExposure> exposure;  // the last that came, of this life
    std::string trouble;                             // why it cannot take part; empty: it can
    std::uint64_t digest = 0;                        // DigestOf its part of the layout
    std::size_t units = 0;
    PlaneOrder order;  // the present one; number 0: none yet
    HostInstant said{INT64_MIN};
    HostInstant body_said{INT64_MIN};
  };

  void BeginEpoch(const PlaneEpoch& epoch);
  void Hear(const SectorReport& report, HostInstant now);
  /// Brings each entry's trouble up to date.
  void Look(HostInstant now);

  [[nodiscard]] std::uint32_t size() const { return static_cast<std::uint32_t>(entries_.size()); }
  [[nodiscard]] const Entry& operator[](std::uint32_t sector) const { return entries_[sector]; }
  [[nodiscard]] bool IsHeard(std::uint32_t sector) const;
  /// The sector is heard, has accepted this epoch, has the same layout, and its clock is known.
  [[nodiscard]] bool IsUsable(std::uint32_t sector) const {
    return entries_[sector].trouble.empty();
  }
  /// The sector is heard, follows this coordinator, and its clock is known to less than plans allow
  /// for.
  [[nodiscard]] bool HasLooseClock(std::uint32_t sector) const;
  [[nodiscard]] PlaneEpoch highest_accepted() const;

  /// The sector is to do this now. The same order again has no effect.
  void Order(std::uint32_t sector, PlaneOrder order);
  /// True: the present order was carried out.
  [[nodiscard]] bool IsDone(std::uint32_t sector) const;
  /// Appends the orders that are due; returns when the next one is.
  HostInstant Say(HostInstant now, std::vector<PlaneOrder>* orders);

 private:
  [[nodiscard]] std::string TroubleOf(const Entry& entry) const;

  const PlaneTimes times_;
  PlaneEpoch epoch_;
  std::uint64_t next_number_ = 1;
  HostInstant now_;
  std::vector<Entry> entries_;
};

}  // namespace focalfleet
