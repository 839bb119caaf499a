// The agent of a sector stands between the plane's coordinator and the sector's own one. Orders
// become commands; the plane is asked where the sector would ask its planner. The agent also speaks
// with the sectors beyond its border.
//
// The start. A sector that misses the start would stand where others are to pass. Therefore an
// ordered start is confirmed between neighbours first: each repeats that it holds the round, and
// whom it has heard say so. A sector starts only where every neighbour of the round was heard
// lately and has heard it in turn. Otherwise it gives the round back. No number of words makes two
// sectors certain of each other: one that falls silent within `confirm_fresh` before the decision
// may stand while its neighbours move. docs/plane.md names this window.
//
// The border. While a round moves, each sector repeats the ends of its units that units beyond the
// border follow, and stops those of its own that would come where others beyond may stand. A
// neighbour that says that it has not started counts as if all its units stood where they began.
//
// A neighbour that falls silent in motion is reported, and nothing is stopped: its units finish by
// themselves, and they count on the space that others were to leave. To stop these as a precaution
// would bring about what it is to prevent.
//
// Pure: time is an argument, and messages, commands and what is to be kept are values.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "fleet/coordinate/commands.h"
#include "fleet/coordinate/configuration_view.h"
#include "fleet/coordinate/effects.h"
#include "fleet/coordinate/inputs.h"
#include "fleet/plane/plane_messages.h"

namespace focalfleet {

struct SectorAgentConfig {
  std::uint32_t sector = 0;
  std::uint64_t layout = 0;                    // DigestOf
  std::string door = {};                       // SectorReport::door
  DurationNs start_delay = Milliseconds(250);  // CoordinatorConfig::start_delay
  DurationNs report_period = Milliseconds(200);
  /// During a round, and before its start while there is time.
  DurationNs news_period = Milliseconds(50);
  /// In the last half second before the start is decided. Five lost in a row give the round back.
  DurationNs confirm_period = Milliseconds(20);
  DurationNs confirm_fresh = Milliseconds(100);
  /// A neighbour in motion that is silent for so long is reported.
  DurationNs suspicion = Milliseconds(300);
  /// A coordinator that gives no order for so long is reported as silent.
  DurationNs plane_silence = Milliseconds(3000);
  /// A round that is held and not heard of for so long is given back.
  DurationNs hold_limit = Milliseconds(15'000);
};

/// All that a sector's coordinator has done in its last step, and all that came from outside.
struct AgentInputs {
  HostInstant now;
  std::span<const PlaneOrder> orders = {};
  std::span<const BorderNews> news = {};
  /// The highest epoch that is durable here.
  PlaneEpoch kept;
  SectorView view;
  const ConfigurationView* configuration = nullptr;
  const PlanJob* job = nullptr;            // of this step, if any
  const ExposureJob* exposure = nullptr;   // the same
  std::span<const UnitDrive> drives = {};  // with `job` and `exposure`
  /// Given now and then while nothing is under way; null: not now.
  std::shared_ptr<const SectorPlaces> places = {};
  std::span<const ReplyEffect> replies = {};
  std::span<const BorderEnd> ends = {};  // by this sector's clock
};

struct AgentEffects {
  std::vector<Command> commands;  // for the sector's coordinator
  std::optional<SectorReport> report;
  std::optional<BorderNews> news;
  std::optional<PlaneEpoch> keep;  // is to be made durable
  std::vector<ShellNote> notes;
  HostInstant wake_at = kNever;
};

class SectorAgent {
 public:
  /// `incarnation` is the number of the daemon's life, from 1 on. `kept` is the stored epoch.
  SectorAgent(const SectorAgentConfig& config, std::uint64_t incarnation, PlaneEpoch kept);

  /// The request number of all commands of the agent; no client has it.
  static constexpr std::uint64_t kRequest = UINT64_MAX;

  void Step(const AgentInputs& inputs, AgentEffects* effects);

  /// Orders that came too late: of an epoch that is over.
  [[nodiscard]] std::uint64_t refused() const { return refused_; }
  [[nodiscard]] const PlaneEpoch& accepted() const { return accepted_; }
  /// The plane's number of the last round that was taken; 0: none.
  [[nodiscard]] std::uint64_t round() const { return round_.number; }

 private:
  /// A neighbour in the present round.
  struct Neighbour {
    std::optional<BorderNews> last;  // of this round
    HostInstant heard;               // by this sector's clock
    std::size_t ends_taken = 0;
    bool lost = false;    // it is not heard
    bool stands = false;  // it has not started
  };
  enum class Course : std::uint8_t { kNone, kHeld, kConfirming, kStarted, kOver };
  /// The round that this sector holds or carries out.
  struct Round {
    Course course = Course::kNone;
    bool began = false;  // the sector's coordinator has started it
    PlaneEpoch epoch;
    std::uint64_t number = 0;
    std::uint64_t job = 0;
    HostInstant start_at;  // by the plane's clock
    HostInstant held_since;
    DurationNs ahead;  // of this sector's clock, while the round lasts
    std::map<std::uint32_t, Neighbour> together;
    std::shared_ptr<const SectorRound> body;
    std::vector<BorderEnd> ends;  // by the plane's clock
  };

  [[nodiscard]] bool Holds() const {
    return round_.course == Course::kHeld || round_.course == Course::kConfirming;
  }
  void Hear(const PlaneOrder& order);
  void Hear(const BorderNews& news);
  void Follow();
  void Obey();
  [[nodiscard]] bool Do(const PlaneOrder& order);
  [[nodiscard]] bool Configure(const PlaneOrder& order);
  [[nodiscard]] bool TakeRound(const PlaneOrder& order);
  [[nodiscard]] bool Retarget(const PlaneOrder& order);
  void Confirm();
  [[nodiscard]] std::string WhoIsMissing() const;
  void GiveBack(const std::string& why);
  void Watch();
  void StopBeyond(std::uint32_t sector, HostInstant from, HostInstant until, std::string reason);
  void Publish();
  [[nodiscard]] SectorReport Report() const;
  [[nodiscard]] BorderNews News() const;
  void Send(decltype(Command::what) what);
  [[nodiscard]] HostInstant Own(HostInstant plane) const;
  [[nodiscard]] HostInstant Plane(HostInstant own) const;

  /// The last report and news, and their instants.
  struct Said {
    HostInstant report{INT64_MIN};
    HostInstant news{INT64_MIN};
    std::uint64_t number = 0;
    SectorStage stage = SectorStage::kIdle;
    std::uint64_t job = 0;
    bool changed = true;
    bool news_changed = false;
  };
  /// The configuration of the plane here.
  struct Here {
    PlaneConfigurationId now;
    std::uint64_t change = 0;  // PlaneOrder::change, carried out
    bool begun = false;        // the sector's coordinator has it
    PlaneConfigurationId last;
    ConfigurationState last_state = ConfigurationState::kDone;
    std::string trouble;
  };

  const SectorAgentConfig config_;
  const std::uint64_t incarnation_;
  PlaneEpoch accepted_;
  std::optional<PlaneOrder> order_;  // the newest of the accepted epoch
  std::uint64_t done_ = 0;           // the number of the last order carried out
  std::optional<HostInstant> ordered_at_;
  bool silence_said_ = false;
  SectorReport::Echo echo_{};
  std::uint64_t refused_ = 0;
  Here here_;
  Round round_;
  std::shared_ptr<const SectorJob> job_;
  std::uint64_t job_seen_ = 0;
  /// The places that were given last.
  struct Places {
    std::shared_ptr<const SectorPlaces> now;
    std::uint64_t digest = 0;
    std::uint64_t seen = 0;
  };
  Places places_;
  std::shared_ptr<const SectorExposure> exposure_;
  std::uint64_t exposure_seen_ = 0;
  Said said_;
  const AgentInputs* in_ = nullptr;  // of the present step
  AgentEffects* out_ = nullptr;      // of the present step
};

}  // namespace focalfleet
