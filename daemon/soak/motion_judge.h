// The motion judge looks at what the host's frames make units do: when a move is to begin, which
// way each unit has before it, and what its motors draw. The judge reads frames by code of its own
// and compares them with the true motion. The rules are:
//
//   start      All start signals of a move name the same instant, on every bus and in every repeat.
//   followers  A unit that has ended by itself stands in the way of no unit that still moves, from
//              1.3 s after its end, and after the other's begin, on.
//   power      The motors of a rail draw no more than a plan may.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "daemon/soak/plant.h"
#include "daemon/soak/troubles.h"
#include "sim/world/world.h"

namespace focalfleet::soak {

/// The power of one motor that turns as the fleet's motors do, as a power meter has it in the
/// simulation at PWM level. Units: W. Cost: some milliseconds at its first call.
double MotorAsMeasured_W();

class MotionJudge {
 public:
  using Broken = std::function<void(const std::string& rule, const std::string& what)>;
  /// `rail_limit_W`: of each rail; 0: none.
  MotionJudge(const Plant* plant, const Troubles* troubles, double rail_limit_W, Broken broken);

  void Sends(BusId bus, const CanFrame& frame, HostInstant now);
  /// Shape of `truths`: (n). `near`: for each unit those of higher rows that its arm may touch.
  void Look(HostInstant now, std::span<const sim::UnitTruth> truths,
            std::span<const std::vector<std::size_t>> near);

 private:
  struct Segment {
    double start_s = 0;
    double delta = 0;  // vectors
    double lasts_s = 0;
  };
  struct Staged {
    std::uint32_t move = 0;
    std::array<std::vector<Segment>, 2> way;
  };
  /// A move that has begun.
  struct Course {
    Staged staged;
    HostInstant began;
    HostInstant halted = kNever;  // before its end; kNever: it has not
    bool over = true;
  };
  void SendsStart(BusId bus, const CanFrame& frame, HostInstant now);
  void Follow(HostInstant now, std::size_t row, const sim::UnitTruth& truth);
  void LookAtFollowers(HostInstant now, std::span<const sim::UnitTruth> truths,
                       std::span<const std::vector<std::size_t>> near);
  [[nodiscard]] std::optional<double> MeetsIn(HostInstant now, std::size_t follower,
                                              std::size_t first,
                                              std::span<const sim::UnitTruth> truths) const;
  void LookAtPower(HostInstant now, std::span<const sim::UnitTruth> truths);
  [[nodiscard]] bool IsExcused(std::size_t row, HostInstant since) const;
  [[nodiscard]] std::size_t BusOf(std::size_t row) const;

  const Plant* plant_;
  const Troubles* troubles_;
  double rail_limit_W_;
  Broken broken_;
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::size_t> rows_;     // by bus and node
  std::map<std::uint32_t, std::pair<HostInstant, HostInstant>> begins_at_;  // by move: named, until
  std::vector<Staged> staged_;
  std::vector<Course> courses_;
  std::vector<std::uint32_t> moves_begun_;
  std::vector<std::array<double, kAxisCount>> vectors_;  // at the last look
  HostInstant looked_{0};
};

}  // namespace focalfleet::soak
