// The firmware of one simulated unit. The protocol's state machine (unit_machine.h) is the very
// code that real firmware starts from. Its board has simulated axes as motors and a clock that runs
// by its own rate. Around it stands the misbehaviour that tests plant.
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
      double fibre_carrier_mm = 0;
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
  /// Does everything that is due. Pre: now is not before any earlier instant.
  void OnTime(HostInstant now, TransmitQueue* out);
  /// An edge of the SYNC line.
  void OnSync(HostInstant now, TransmitQueue* out);
  /// The instant at which OnTime is due next; kNever without power.
  [[nodiscard]] HostInstant deadline() const;

  /// The unit stops at once and stays in kFault until the fault is cleared.
  void RaiseFault(const Trip& trip, HostInstant now, TransmitQueue* out);

  [[nodiscard]] UnitState state() const { return machine_.state(); }
  [[nodiscard]] FaultCode fault() const { return machine_.fault(); }
  [[nodiscard]] bool powered() const { return machine_.powered(); }
  [[nodiscard]] bool interrupted() const { return machine_.interrupted(); }
  [[nodiscard]] std::uint64_t malformed() const { return machine_.malformed(); }

 private:
  [[nodiscard]] Board MakeBoard();
  void Sense(HostInstant now, std::span<std::uint16_t> counts);
  /// Sets the instant of the planted fault. To be called after any frame or event that may begin or
  /// end a motion.
  void FollowMotion();
  void TripIfDue(HostInstant now, TransmitQueue* out);
  /// Hands on the machine's answers, changed by the planted faults.
  enum class Cause { kFrame, kTime };
  /// True where a planted fault keeps the frame from the machine.
  bool Withheld(const CanFrame& frame, HostInstant now, TransmitQueue* out);
  [[nodiscard]] std::optional<UnitMessage> Refused(const Addressed<HostMessage>& request,
                                                   HostInstant now);
  void Pass(const TransmitQueue& said, Cause cause, TransmitQueue* out) const;
  [[nodiscard]] CanFrame Distorted(const CanFrame& frame) const;

  Hardware hardware_;
  UnitMachine machine_;
  HostInstant powered_at_;
  std::uint32_t motions_seen_ = 0;  // of Flash::moves_begun
  HostInstant trip_at_ = kNever;    // the instant of the planted fault
  // The sequence number of the last request to this unit alone, for answers under the wrong one.
  std::uint8_t sequence_ = 0;
  std::uint32_t readings_ = 0;  // of the sensors
  std::uint8_t sequence_before_ = 0;
};

}  // namespace focalfleet::sim
