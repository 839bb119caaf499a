// The words of a plane. Every message has the whole present state of its sender and is repeated, so
// that a lost, doubled or late one does no harm: the newest that arrives is enough.
//
//   PlaneOrder    coordinator -> one sector   what the sector is to do now
//   SectorReport  sector -> coordinator       how far it is; the acknowledgement of orders
//   BorderNews    sector -> its neighbours    before and during a round
//
// Fencing. A coordinator speaks in an epoch. A sector keeps the highest epoch that it has accepted
// in its store, and takes no word of a lower one. Two coordinators never have the same epoch,
// because it ends with the coordinator's own number.
//
// Instants in messages are by the plane's clock unless their name says otherwise.
#pragma once

#include <compare>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "fleet/coordinate/commands.h"
#include "fleet/coordinate/sector_round.h"
#include "fleet/knowledge.h"
#include "fleet/records.h"
#include "protocol/base/instants.h"

namespace focalfleet {

/// For people.
inline std::string NameOfSector(std::uint32_t sector) { return "sector " + std::to_string(sector); }

struct PlaneEpoch {
  std::uint64_t number = 0;  // 0: none yet
  std::uint64_t coordinator = 0;
  constexpr auto operator<=>(const PlaneEpoch&) const = default;
};

/// A configuration over sectors: its coordinator, and that one's number for it. Two coordinators
/// number theirs by themselves.
struct PlaneConfigurationId {
  std::uint64_t coordinator = 0;
  std::uint64_t number = 0;  // 0: none
  constexpr bool operator==(const PlaneConfigurationId&) const = default;
};

enum class OrderKind : std::uint8_t {
  kStand,      // nothing to do; begins an epoch
  kConfigure,  // begins a configuration, `task`
  kRound,      // the sector's part of a plan, `round_body`
  kStart,      // the round that is held starts
  kWithdraw,   // the round that is held is given back
  kStop,
  kRetarget,  // units of the configuration under way have other targets, `retargets`
  kFindings,  // of the exposure `job` that the sector asks for, `findings`
};
inline constexpr OrderKind kLastOrderKind = OrderKind::kFindings;

/// A unit of the configuration under way has another target.
struct SectorRetarget {
  std::uint64_t number = 0;  // of the change; grows within a configuration
  SectorRetargetCommand::Target target;
};

struct PlaneOrder {
  PlaneEpoch epoch = {};
  std::uint32_t sector = 0;
  std::uint64_t incarnation = 0;  // the life of the sector that is meant; 0: any
  std::uint64_t number = 0;       // of the order, grows within the epoch
  OrderKind kind = OrderKind::kStand;
  PlaneConfigurationId configuration = {};
  std::uint64_t round = 0;    // of kRound and kStart; grows within the epoch
  std::uint64_t job = 0;      // the sector's, of kRound, kStart, kWithdraw and kFindings
  HostInstant start_at = {};  // of kStart
  /// For kRound: sectors beyond the border that move in this round, too. None of them starts
  /// without the others.
  std::vector<std::uint32_t> together = {};
  HostInstant sent = {};
  std::optional<DurationNs> ahead = {};  // the sector's clock less the plane's; none: not known yet
  std::uint64_t job_seen = 0;            // the last job of the sector that arrived
  std::uint64_t places_seen = 0;         // DigestOf the last places of the sector that arrived
  std::uint64_t exposure_seen = 0;       // the last exposure asked for that arrived
  /// The last change of targets: `task` has those up to it, or `retargets` all of the sector.
  std::uint64_t change = 0;
  std::vector<SectorRetarget> retargets = {};
  /// The body of the order. Null: the order is repeated without, because the sector has it.
  std::shared_ptr<const SectorTask> task = {};
  std::shared_ptr<const SectorRound> round_body = {};
  std::shared_ptr<const Result<ExposureFindings>> findings = {};  // units by the sector's positions
};

/// Where the units of a sector stand, and their drives, while nothing is under way: targets are
/// resolved with them.
struct SectorPlaces {
  std::vector<UnitKnowledge> places;  // Shape: (units of the sector)
  std::vector<UnitDrive> drives;      // Shape: the same
};
std::uint64_t DigestOf(const SectorPlaces& places);
/// The fault of places that came from outside; empty: none.
std::string FaultOf(const SectorPlaces& places, std::size_t units);

/// The sector asks for a plan: as a PlanJob, with what is the sector's own.
struct SectorJob {
  std::uint64_t job = 0;
  std::vector<UnitKnowledge> start;  // Shape: (units of the sector), as all lists
  std::vector<std::optional<Pose>> targets;
  std::vector<std::uint8_t> frozen;
  std::vector<Pose> offsets;
  std::vector<UnitDrive> drives;
  std::vector<PositionerIndex> to_home = {};  // ascending; `targets` are none then
  bool unproven = false;                      // HomeCommand::unproven
  bool fixed = false;
  bool leave_stuck = false;  // PlanOptions::leave_stuck
  double start_skew_s = 0;
  double notice_s = 0;
};
/// The fault of a job that came from outside; empty: none.
std::string FaultOf(const SectorJob& job, std::size_t units);

/// The sector asks for the places of its units in an exposure: as an ExposureJob.
struct SectorExposure {
  std::uint64_t id = 0;
  bool first = false;                   // its units are to be found before any unit moves
  std::vector<UnitKnowledge> expected;  // Shape: (units of the sector), as all lists
  std::vector<std::optional<Pose>> before;
  std::vector<std::optional<Pose>> reported;
  std::vector<std::uint8_t> seen;
  std::vector<std::uint8_t> wanted;
  double tolerance_um = 0;
  std::vector<UnitDrive> drives;
};
/// The fault of an exposure that came from outside; empty: none.
std::string FaultOf(const SectorExposure& exposure, std::size_t units);

struct SectorReport {
  std::uint32_t sector = 0;
  std::uint64_t incarnation = 0;  // the number of the daemon's life, from 1 on; grows
  std::uint64_t layout = 0;       // DigestOf
  std::uint64_t number = 0;       // grows within a life
  PlaneEpoch accepted;
  /// Since the last order of the accepted epoch; a coordinator that waits sees whether another is
  /// there.
  DurationNs unordered;
  std::uint64_t order = 0;  // the last one that was carried out
  SectorStage stage = SectorStage::kIdle;
  PlaneConfigurationId configuration;  // the one under way
  std::uint64_t change = 0;            // PlaneOrder::change of it, carried out
  std::uint64_t job = 0;               // the last one asked for
  std::uint64_t round = 0;         // the plane's number of the one that is held or moves; 0: none
  PlaneConfigurationId last_over;  // the last one that ended here
  ConfigurationState last_state = ConfigurationState::kDone;
  OutcomeCounts counts;  // of the configuration under way, or the last one
  double start_delay_s = 0;
  std::string trouble;  // why an order was not taken; usually empty
  std::string door;     // where the sector's daemon takes requests, for people: host:socket
  /// The last order that was heard, for the clocks (sector_clock.h). Not used before there is one.
  struct Echo {
    HostInstant sent;
    HostInstant received;  // by the sector's clock
    HostInstant returned;  // by the sector's clock
  };
  std::optional<Echo> echo = {};
  std::shared_ptr<const SectorJob> body = {};  // null: the coordinator has it
  std::uint64_t places_now = 0;  // DigestOf the present places; 0: it does not rest, or not yet
  std::shared_ptr<const SectorPlaces> places = {};      // null: the coordinator has them
  std::shared_ptr<const SectorExposure> exposure = {};  // null: the same
};

/// How far a sector is with a round, for its neighbours.
enum class BorderStage : std::uint8_t { kOut, kHolding, kStarted, kOver };

struct BorderNews {
  std::uint32_t sector = 0;
  std::uint64_t incarnation = 0;
  std::uint64_t number = 0;  // grows within a life
  PlaneEpoch epoch;
  std::uint64_t round = 0;
  BorderStage stage = BorderStage::kOut;
  HostInstant start_at;
  std::vector<std::uint32_t> heard;  // sectors that hold or have started this round
  std::vector<BorderEnd> ends;       // of this round, all so far
};

}  // namespace focalfleet
