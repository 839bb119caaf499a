// A night is one seed: the whole system on virtual time, in one thread, bit for bit the same each
// time. Its first phase is one of safety: anything may fail, and the judge looks on. In the second,
// of liveness, all faults have ended; operators set right what is not, and then the fleet must
// carry out a configuration.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/journal/step_record.h"
#include "daemon/soak/draws.h"
#include "daemon/soak/fault_injector.h"
#include "daemon/soak/judge.h"
#include "daemon/soak/life.h"
#include "daemon/soak/liveness.h"
#include "daemon/soak/operators.h"
#include "daemon/soak/week.h"

namespace focalfleet::soak {

struct NightResult {
  std::uint64_t seed = 0;
  std::vector<std::string> broken;  // rules, with time and reason; empty: none
  FaultCounts reached{};
  std::uint64_t digest = 0;
  double virtual_s = 0;
  std::uint64_t lives = 0;
  std::uint64_t steps = 0;
  std::uint64_t commits = 0;
  std::uint64_t commits_failed = 0;
  std::uint64_t frames = 0;
  std::uint64_t answers = 0;
  std::uint64_t units_begun = 0;
  [[nodiscard]] bool ok() const { return broken.empty(); }
};

struct NightOptions {
  /// Takes a line for each change of state; none: nothing is reported.
  std::function<void(const std::string&)> tell;
  /// Each step of each life is taken again by another coordinator, which must decide the same.
  bool replay = false;
  /// The log of the daemon; none: it is not kept.
  std::function<void(const std::string&)> log;
  std::uint32_t keep_days = 0;  // of history; 0: all
};

class Night {
 public:
  Night(const Draws& draws, const NightOptions& options);
  NightResult Run();
  /// Instead of a night; `take` gets the sizes after each configuration. Pre: the draws have no
  /// faults.
  NightResult RunWeek(const Week& week, const std::function<void(const WeekSizes&)>& take);

 private:
  NightResult Finish();
  void PassDay();
  [[nodiscard]] WeekSizes SizesAfter(std::uint32_t configuration, std::uint32_t night) const;
  Surroundings Around();
  void RunUntil(HostInstant end, const std::function<bool()>& done = {});
  void TurnOfLife();
  void StartLife();
  void Die(FaultSite site);
  /// A fault of the host. False: it met nothing.
  bool OfHost(FaultSite site);
  int OfDisk(DiskOperation operation);
  void Passed(TurnPoint point);
  void Committed(std::span<const Row> rows, bool done);
  void Sends(BusId bus, const CanFrame& frame);
  bool Hear(ClientId client, std::string_view line, bool last);
  void Look();
  void Tell(const std::string& what);
  [[nodiscard]] Liveness SecondPhase();
  void Converge();

  Draws draws_;
  NightOptions options_;
  Troubles troubles_;
  FaultCounts reached_{};
  NightResult result_;
  std::unique_ptr<Plant> plant_;
  std::unique_ptr<MemoryDisk> disk_;
  std::unique_ptr<Judge> judge_;
  std::unique_ptr<FaultInjector> faults_;
  std::unique_ptr<Operators> operators_;
  std::unique_ptr<Life> life_;
  HostInstant now_;
  HostInstant start_at_;
  HostInstant frozen_until_;
  HostInstant look_at_;
  /// The end of the present life.
  struct Death {
    bool power_cut = false;  // it is one of the host's power
    bool in_start = false;
    std::optional<FaultSite> dying = {};  // within SQLite, which cannot be left by an exception
  } death_;
  std::string state_;                            // as last reported
  std::unique_ptr<journal::Replayer> replayer_;  // of this life; none: it is not replayed
  std::uint64_t digest_ = 0xcbf29ce484222325u;
};

}  // namespace focalfleet::soak
