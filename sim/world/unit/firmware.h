// One simulated unit's firmware: the protocol's state machine (unit_machine.h), the very code that
// firmware starts from, on a board whose motors are simulated axes and whose clock runs by its own
// rate; and around it the misbehaviour that tests plant.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "protocol/base/instants.h"
#include "protocol/wire/can_frame.h"
#include "protocol/wire/codec.h"
#include "sim/world/axis/axis.h"
#include "sim/world/faults.h"
#include "sim/world/mechanism.h"
#include "sim/world/unit/joint_sensors.h"
#include "sim/world/unit/unit_machine.h"

namespace focalfleet::sim {

class Firmware {
 public:
  /// All that is pointed at outlives the firmware.
  struct Hardware {
    NodeId node;
    UnitClock clock;
    Flash* flash = nullptr;
    std::array<AxisModel*, kAxisCount> axis{};
    UnitFaults* faults = nullptr;
    struct Joint {
      UnitId unit;
      std::uint8_t sensors = 0;
      double carrier_mm = 0;
      const Mechanism* mechanism = nullptr;
      const JointSensors* magnets = nullptr;
    };
    Joint joint = {};  // where it has sensors
  };
  using Trip = UnitMachine::Trip;

  explicit Firmware(const Hardware& hardware);
  Firmware(const Firmware&) = delete;  // the machine's board points to it
  Firmware& operator=(const Firmware&) = delete;
  ~Firmware() = default;

  void PowerOn(HostInstant now);
  void PowerOff(HostInstant now);

  void OnFrame(const CanFrame& frame, HostInstant now, TransmitQueue* out);
  /// Does what is due. Pre: now is not before anything told so far.
  void OnTime(HostInstant now, TransmitQueue* out);
  /// An edge of the SYNC line.
  void OnSync(HostInstant now, TransmitQueue* out);
  /// When OnTime is due next; kNever without power.
  [[nodiscard]] HostInstant deadline() const;

  /// Stops at once and stays in kFault until the fault is cleared.
  void RaiseFault(const Trip& trip, HostInstant now, TransmitQueue* out);

  [[nodiscard]] UnitState state() const { return machine_.state(); }
  [[nodiscard]] FaultCode fault() const { return machine_.fault(); }
  [[nodiscard]] bool powered() const { return machine_.powered(); }
  [[nodiscard]] bool interrupted() const { return machine_.interrupted(); }
  [[nodiscard]] std::uint64_t malformed() const { return machine_.malformed(); }

 private:
  [[nodiscard]] Board MakeBoard();
  void Sense(HostInstant now, std::span<std::uint16_t> counts);
  /// After whatever may have begun or ended a motion: when the planted fault is due.
  void FollowMotion();
  void TripIfDue(HostInstant now, TransmitQueue* out);
  /// Hands on what the machine said, with what is planted done to it.
  enum class Cause { kFrame, kTime };
  /// True where what is planted keeps the machine from hearing the frame.
  bool Withheld(const CanFrame& frame, HostInstant now, TransmitQueue* out);
  [[nodiscard]] std::optional<UnitMessage> Refused(const Addressed<HostMessage>& request,
                                                   HostInstant now);
  void Pass(const TransmitQueue& said, Cause cause, TransmitQueue* out) const;
  [[nodiscard]] CanFrame Distorted(const CanFrame& frame) const;

  Hardware hardware_;
  UnitMachine machine_;
  HostInstant powered_at_;
  std::uint32_t motions_seen_ = 0;  // of Flash::moves_begun
  HostInstant trip_at_ = kNever;    // planted
  // Of the requests to it alone, for answers under the wrong one.
  std::uint8_t sequence_ = 0;
  std::uint32_t readings_ = 0;  // of the sensors
  std::uint8_t sequence_before_ = 0;
};

}  // namespace focalfleet::sim
