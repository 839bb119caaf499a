// The simulated fleet: every unit on every bus, on virtual time. The host reaches it through frames
// alone. The true state (shaft angles, fibre positions) is for tests and reports; the coordinator
// never sees it.
//
// The world goes from event to event and never in steps of time. Events are the end of a frame, the
// begin or end of a motion, and a time-out of the host; motion in between is a closed form. 5000
// units at rest cost nothing but the frames that they are sent.
//
//   world.Inject(bus, frame, now);   the host's controller takes a frame
//   world.AdvanceTo(t, &received);   the frames that the host receives until t, t included
//   world.NextEvent()                the instant at which the world next does something by itself
//
// Each bus has one controller on the host's side, with a mailbox for every waiting frame. The
// lowest identifier among the frames that wait anywhere on a bus goes first, and of equal ones the
// first come. An `arm` therefore passes an upload that still waits. Begin, segments and read-back
// of an upload keep their order by their identifiers.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "protocol/base/ids.h"
#include "protocol/base/instants.h"
#include "protocol/base/result.h"
#include "protocol/link/frame_port.h"
#include "sim/world/axis/axis_memory.h"
#include "sim/world/bus/bus.h"
#include "sim/world/disturbances.h"
#include "sim/world/fault_plan.h"
#include "sim/world/faults.h"
#include "sim/world/spread.h"
#include "sim/world/unit/flash.h"
#include "sim/world/unit/joint_sensors.h"
#include "sim/world/unit_description.h"

namespace focalfleet::sim {

/// The state of a unit that outlives the process, as a later run finds it.
struct UnitMemory {
  UnitId id;
  Flash flash;
  std::array<AxisMemory, kAxisCount> axis;
};

struct WorldConfig {
  std::vector<UnitDescription> units;
  std::uint64_t seed = 1;
  Spread spread = Spread::kNominal;
  std::vector<PlantedTrait> planted = {};  // on top of the spread
  std::uint32_t bit_rate_bps = 1'000'000;
  HostInstant start{0};  // power-on of all units
  FactoryDrive drive;
  double clock_error_max = 50e-6;  // of each unit's clock, drawn evenly from -max..max
  // From the end of a frame to its answer in the mailbox.
  DurationNs answer_delay = Microseconds(30);
  /// False where a real bus arbitrates and takes its time: frames pass at once, in order.
  bool bit_clock = true;
  std::vector<UnitMemory> memory;  // of an earlier run, matched by unit id
  /// The time from the bus-off of a bus' host controller to its restart; kNever: it waits for
  /// RestartHost.
  DurationNs host_restart = Milliseconds(1000);
  /// The sensors of units with a ball-jointed fibre carrier; none: there are no such units.
  std::shared_ptr<const JointSensors> joint_sensors = {};
  std::vector<PlannedFault> faults;  // by the clock, from `start` on
};

/// The state of a CAN controller.
struct Controller {
  Confinement state = Confinement::kActive;
  bool warns = false;
  std::uint32_t transmit_errors = 0;
  std::uint32_t receive_errors = 0;
};

/// The true state of one unit, at World::now().
struct UnitTruth {
  UnitId id;
  std::array<double, kAxisCount> angle_deg{};  // of the output shaft
  std::array<double, kAxisCount>
      vectors{};  // the same in vectors from the axis' zero, with fractions
  std::array<std::int32_t, kAxisCount> applied{};  // the vector that its firmware applies now
  double x_mm = 0;                                 // fibre, focal-plane frame
  double y_mm = 0;
  UnitState state = UnitState::kRest;
  FaultCode fault = FaultCode::kNone;
  bool powered = true;
  bool interrupted = false;
  std::uint32_t moves_begun = 0;
  MoveId last_move;
  std::uint32_t begun_twice = 0;  // moves that were begun a second time: must stay 0
  HostInstant began = kNever;     // begin of its last motion; kNever: none in this run
  double clock_error = 0;         // seconds of its clock a second of the world's, less 1
};

/// A frame as the wire carried it, for listeners beside the host.
struct WireFrame {
  BusId bus;
  HostInstant at;  // its end
  CanFrame frame;
  bool from_unit = false;
  std::uint32_t client = 0;  // the client that injected it, where it is not from a unit
};

class World {
 public:
  /// Returns the first fault in the units (bus, node or id used twice, range the wrong way round
  /// ...).
  static Status Validate(const WorldConfig& config);

  /// Pre: Validate(config) succeeds.
  explicit World(WorldConfig config);
  World(const World&) = delete;
  World& operator=(const World&) = delete;
  ~World();

  /// The host's frame waits for the bus from `at` on (now, where `at` has passed). False: no
  /// mailbox is left, the bus is dead, or there is none of that number; the frame is lost and
  /// counted.
  bool Inject(BusId bus, const CanFrame& frame, HostInstant at, std::uint32_t client = 0);

  /// Lets time pass. The frames that the host receives are appended to `delivered`, and every frame
  /// of every bus to `wire` where that is given. Both are in order of time.
  void AdvanceTo(HostInstant at, std::vector<ReceivedFrame>* delivered,
                 std::vector<WireFrame>* wire = nullptr);

  /// The instant of the next event; kNever: only a frame from the host can make something happen.
  [[nodiscard]] HostInstant NextEvent() const;
  [[nodiscard]] HostInstant now() const;

  /// Puts an edge on the SYNC line, which goes to every unit of every bus; at now().
  void PulseSync();

  /// The disturbances of this world; valid as long as the world.
  [[nodiscard]] Disturbances disturb() { return Disturbances(core_.get()); }

  // ---- the true state

  [[nodiscard]] std::span<const UnitDescription> units() const;
  [[nodiscard]] std::span<const BusId> buses() const;  // ascending
  [[nodiscard]] std::optional<std::size_t> Find(UnitId unit) const;
  [[nodiscard]] UnitTruth Truth(std::size_t row) const;  // row in units()
  [[nodiscard]] UnitTruth Truth(UnitId unit) const;      // Pre: it exists
  [[nodiscard]] const Flash& flash(UnitId unit) const;   // Pre: it exists
  [[nodiscard]] bool dead(BusId bus) const;
  /// The number of frames that wait or are on their way on this bus.
  [[nodiscard]] std::size_t waiting(BusId bus) const;
  [[nodiscard]] BusCounters counters(BusId bus) const;
  [[nodiscard]] Controller controller(BusId bus) const;    // the host's. Pre: there is such a bus
  [[nodiscard]] Controller controller(UnitId unit) const;  // Pre: it exists
  /// FLASH and mechanics of all units at now(), as a later run would find them.
  [[nodiscard]] std::vector<UnitMemory> Memory() const;

 private:
  std::unique_ptr<WorldCore> core_;
  FaultSchedule schedule_;
};

}  // namespace focalfleet::sim
