// The second phase of a night: faults have ended, operators do what the runbook says, and the fleet
// must then carry out a configuration.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "daemon/soak/judge.h"
#include "daemon/soak/operators.h"
#include "fleet/coordinator.h"

namespace focalfleet::soak {

class Liveness {
 public:
  struct Parts {
    const Layout* layout = nullptr;
    Operators* operators = nullptr;
    Judge* judge = nullptr;
    /// The coordinator of the present life; null: there is none.
    std::function<const Coordinator*()> coordinator;
    /// Lets the night go on for so long, or until it is done.
    std::function<void(double seconds, const std::function<bool()>& done)> run;
    std::function<void(const std::string&)> tell;
  };
  explicit Liveness(Parts parts) : parts_(std::move(parts)) {}

  /// Judges whether all ends well.
  void Converge();

  bool WaitFor(std::uint64_t request, double seconds);
  /// No configuration is under way, and no unit is being asked who it is.
  bool Settle(double seconds);
  /// A person reads an answer before the next command.
  void Pause();

 private:
  [[nodiscard]] std::vector<std::uint32_t> UnitsThat(
      const std::function<bool(const UnitView&)>& wanted) const;
  [[nodiscard]] bool good() const { return parts_.judge->broken().empty(); }
  void SetRight();
  void ClearFaults();
  void HomeLost();
  std::vector<std::uint32_t> LeaveOutTouching();
  [[nodiscard]] std::size_t BlockedBeside(std::span<const std::uint32_t> left_out,
                                          const nlohmann::json& answer) const;
  void CheckEnd();

  Parts parts_;
};

}  // namespace focalfleet::soak
