// Fault confinement of one CAN controller: its two error counters and the actions that they still
// allow. The rule numbers are those of Bosch CAN 2.0 part B, section 8, which ISO 11898-1 took
// over:
//
//   1  a receiver that detects an error:                          REC + 1
//   2  a receiver that sees dominant right behind its error flag: REC + 8
//   3  a transmitter that sends an error flag:                    TEC + 8, but for
//        exception 1: error-passive, no acknowledgement, and nobody dominant during its flag
//        exception 2: a recessive stuff bit was seen dominant during arbitration
//   6  eight more dominant bits behind a flag:                    TEC + 8, REC + 8
//   7  a frame that was transmitted well:                         TEC - 1
//   8  a frame that was received well:                            REC - 1, from above 127 to 119
//   9  TEC or REC of 128 and more: error-passive;  11: both below again: error-active
//   10 TEC of 256 and more: bus-off;  12: 128 times 11 recessive bits: active, both counters 0
#pragma once

#include <algorithm>
#include <cstdint>

namespace focalfleet::sim {

enum class Confinement : std::uint8_t { kActive, kPassive, kOff };
constexpr const char* Name(Confinement confinement) {
  constexpr const char* kNames[] = {"active", "passive", "off"};
  return kNames[static_cast<std::size_t>(confinement)];
}

class ErrorCounters {
 public:
  static constexpr std::uint32_t kWarning = 96;
  static constexpr std::uint32_t kPassive = 128;
  static constexpr std::uint32_t kOff = 256;

  void ReceiveError() { Receive(1); }                           // rule 1
  void DominantBehindFlag() { Receive(8); }                     // rules 2 and 6
  void TransmitError() { transmit_ += 8; }                      // rules 3 and 6
  void Transmitted() { transmit_ -= transmit_ > 0 ? 1u : 0u; }  // rule 7
  void Received() {                                             // rule 8
    if (receive_ >= kPassive) {
      receive_ = kPassive - 9;
    } else if (receive_ > 0) {
      --receive_;
    }
  }
  void Recover() { transmit_ = receive_ = 0; }  // rule 12

  [[nodiscard]] Confinement state() const {
    if (transmit_ >= kOff) return Confinement::kOff;
    return std::max(transmit_, receive_) >= kPassive ? Confinement::kPassive : Confinement::kActive;
  }
  /// The errors deserve attention, while the controller works as usual.
  [[nodiscard]] bool warns() const { return std::max(transmit_, receive_) >= kWarning; }
  [[nodiscard]] bool clean() const { return transmit_ == 0 && receive_ == 0; }
  [[nodiscard]] std::uint32_t transmit() const { return transmit_; }
  [[nodiscard]] std::uint32_t receive() const { return receive_; }

 private:
  // Rule 8 drops the part above 127, and a controller's register has eight bits.
  void Receive(std::uint32_t more) { receive_ = std::min<std::uint32_t>(receive_ + more, 255); }

  std::uint32_t transmit_ = 0;
  std::uint32_t receive_ = 0;
};

}  // namespace focalfleet::sim
