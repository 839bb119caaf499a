// The critical n and the paper's conclusions from it. The sets' loads were fitted to n = 37 without
// dead time, so the bridge is ideal here unless stated otherwise.

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "sim/drive/reproduction/parts.h"
#include "sim/drive/start_study.h"
#include "sim/drive/steady.h"

namespace focalfleet::sim::reproduction {
namespace {

constexpr double kVoltages[] = {1.7, 1.8, 2, 2.5, 3, 3.5, 4, 5, 6, 7, 8, 9, 9.2};
constexpr int kFinalRepeat = 108;

struct SetResult {
  std::string name;
  Drive::Setting at_1V8;
  int critical = 0;
  int critical_dead_time = 0;
};

// The share done, step by step; the steps of one stage have about equal cost.
class Steps {
 public:
  Steps(const ReproduceProgress& progress, double from, double to, int steps)
      : progress_(progress), share_(from), step_((to - from) / steps) {}
  void Begin(const std::string& next) const { progress_(share_, next); }
  void Done() { share_ += step_; }

 private:
  const ReproduceProgress& progress_;
  double share_;
  double step_;
};

DriveLevel LevelOf(const ReproduceOptions& options) {
  return options.full ? DriveLevel::kPwm : DriveLevel::kReduced;
}

// With `--full` the critical n is found at PWM level; a different result of the reduced drive is
// reported.
struct Searched {
  int repeat = 0;
  double real = 0;  // not rounded, by the reduced drive
  int reduced = 0;
};
Searched Search(const ReproduceOptions& options, const Drive::Setting& setting) {
  Searched found;
  found.real = CriticalRepeatReal(setting, {}).value_or(std::nan(""));
  // The rounding is that of CriticalRepeat: the real n is the upper end of a bracket of a
  // thousandth.
  if (std::isfinite(found.real)) found.reduced = static_cast<int>(std::ceil(found.real - 1e-3));
  found.repeat =
      options.full ? CriticalRepeat(setting, {}, {}, DriveLevel::kPwm).value_or(0) : found.reduced;
  return found;
}

}  // namespace

void AddStarts(const ReproduceOptions& options, const ReproduceProgress& progress,
               Reproduction* out) {
  const auto add = [out](Claim claim) { out->claims.push_back(std::move(claim)); };
  std::vector<SetResult> sets;
  double loaded_9V = 1e9;  // the least critical n of a loaded motor at 9 V
  // The steps of one set: three searches or so at 1.8 V, the moves with two n, then the voltages.
  constexpr int kMovesReported = 24;
  constexpr int kStepsBefore = 3;
  Steps steps(progress, 0.2, 0.9,
              static_cast<int>(options.start_sets.size()) *
                  (kStepsBefore + kMovesReported + static_cast<int>(std::size(kVoltages))));

  Claim torque{.id = "torque_margin",
               .text = "with n 108 the torque has nearly twice the margin",
               .paper = {2},
               .unit = "pull-out over worst load and drag, by set",
               .conditions = "1.8 V, n 108"};
  for (const std::string_view name : options.start_sets) {
    const std::string of_set = "starts of set " + std::string(name);
    steps.Begin(of_set);
    SetResult set{std::string(name), Ideal(PaperSetting(options, name, 1.8))};
    set.critical = Search(options, set.at_1V8).repeat;
    set.critical_dead_time = Search(options, PaperSetting(options, name, 1.8)).repeat;
    for (int k = 0; k < kStepsBefore; ++k) steps.Done();

    // Whole moves run with the n found and one less, and for both the first turns at PWM level.
    int moves_reported = 0;
    const auto on_move = [&] {
      ++moves_reported;
      steps.Done();
      steps.Begin(of_set + ", move " + std::to_string(moves_reported) + " of 24");
    };
    const auto tried = [&](int repeat) {
      return TryMoves(set.at_1V8, {.repeat = repeat}, {.on_move = on_move}, LevelOf(options));
    };
    const auto starts_at_pwm = [&](int repeat) {
      return StartsAtWorstLoad(set.at_1V8, {.repeat = repeat}, {}, DriveLevel::kPwm);
    };
    Claim critical{.id = "critical_n_" + set.name,
                   .text = "the critical n at 1.8 V is 37",
                   .paper = {37},
                   .simulated = {static_cast<double>(set.critical)},
                   .unit = "",
                   .conditions =
                       "12 moves of 300 degrees from rest, no ramp, ideal bridge; "
                       "searched at " +
                       std::string(options.full ? "PWM level" : "the reduced level")};
    bool confirmed = false;
    if (set.critical > 1) {
      const int below = set.critical - 1;
      const MoveCount with = tried(set.critical);
      const MoveCount without = tried(below);
      const bool starts = starts_at_pwm(set.critical);
      const bool starts_below = starts_at_pwm(below);
      confirmed = with.all() && !without.all() && starts && !starts_below;
      critical.conditions +=
          "; moves that succeed (" + std::string(options.full ? "PWM" : "reduced") +
          "): " + std::to_string(with.succeeded) + " of 12 with n " + std::to_string(set.critical) +
          ", " + std::to_string(without.succeeded) + " with " + std::to_string(below) +
          "; first 60 turns at PWM level: " + (starts ? "starts" : "fails") + " with " +
          std::to_string(set.critical) + ", " + (starts_below ? "starts" : "fails") + " with " +
          std::to_string(below);
    }
    const bool holds = set.critical == 37 && confirmed;
    critical.status = holds ? ClaimStatus::kFitted : ClaimStatus::kDisagrees;
    critical.reason = holds ? "parameter: mean load at the motor shaft, " +
                                  std::to_string(set.at_1V8.motor.load_Nm * 1e6) + " uNm"
                            : "load and flux were fitted to 37 with the printed "
                              "resistance";
    add(std::move(critical));

    for (; moves_reported < kMovesReported; ++moves_reported) steps.Done();

    Claim falls{.id = "n_over_v_bus_" + set.name,
                .text = "n falls as V_bus rises",
                .unit = "n",
                .conditions = "V_bus 1.7 1.8 2 2.5 3 3.5 4 5 6 7 8 9 9.2 V"};
    Claim product{.id = "v_bus_times_n_" + set.name,
                  .text = "V_bus n rises gradually with V_bus",
                  .unit = "V: at 1.7 V, least, at 9.2 V (n not rounded)",
                  .conditions = falls.conditions};
    ClaimCurve curve{
        .figure = "critical n over V_bus", .name = "set " + set.name, .x = {}, .y = {}};
    ClaimCurve product_curve{
        .figure = "V_bus n over V_bus", .name = "set " + set.name, .x = {}, .y = {}};
    std::string differs;
    for (const double v_bus_V : kVoltages) {
      steps.Begin(of_set + ", n over V_bus");
      const Searched found = Search(options, Ideal(PaperSetting(options, name, v_bus_V)));
      steps.Done();
      falls.simulated.push_back(found.repeat > 0 ? found.repeat : std::nan(""));
      if (found.repeat != found.reduced)
        differs += (differs.empty() ? "" : ", ") + std::to_string(found.reduced) + " for " +
                   std::to_string(found.repeat);
      if (v_bus_V == 9) loaded_9V = std::min(loaded_9V, falls.simulated.back());
      product_curve.x.push_back(v_bus_V);
      product_curve.y.push_back(found.real * v_bus_V);
      curve.x.push_back(v_bus_V);
      curve.y.push_back(found.real);
    }
    if (options.full)
      falls.conditions += "; each searched at PWM level, first 60 turns; the reduced drive's are " +
                          (differs.empty() ? std::string("the same") : differs);
    falls.status = InOrder(curve.y, Order::kFalls) == ClaimStatus::kOrdering
                       ? ClaimStatus::kReproduced
                       : ClaimStatus::kDisagrees;
    const auto least = std::min_element(product_curve.y.begin(), product_curve.y.end());
    product.simulated = {product_curve.y.front(), *least, product_curve.y.back()};
    // No fall from any earlier voltage exceeds 1 %, which looks flat in Fig. 9; the end is higher
    // than the begin.
    double highest = 0;
    double deepest = 0;
    for (const double at : product_curve.y) {
      highest = std::max(highest, at);
      deepest = std::max(deepest, 1 - at / highest);
    }
    const bool rises =
        deepest < 0.01 && product.simulated[2] > product.simulated[0] && std::isfinite(deepest);
    product.status = rises ? ClaimStatus::kOrdering : ClaimStatus::kDisagrees;
    product.reason = rises ? ""
                           : "pull-out decides at low voltage: there n falls faster than "
                             "1 / V_bus; only where inertia decides it falls slower";
    add(std::move(falls));
    add(std::move(product));
    out->curves.push_back(std::move(curve));
    out->curves.push_back(std::move(product_curve));

    const Modulation final{.repeat = kFinalRepeat};
    const MotorParameters& motor = set.at_1V8.motor;
    const double worst_Nm = motor.load_Nm * (1 + motor.load_variation) +
                            motor.viscous_Nms * 2 * std::numbers::pi * final.field_Hz();
    torque.simulated.push_back(PullOutTorque(set.at_1V8, final) / worst_Nm);
    sets.push_back(std::move(set));
  }

  Claim dead{.id = "critical_n_dead_time",
             .text = "the critical n with 50 ns of dead time and 10 ns ramps",
             .paper = {37},
             .unit = "by set",
             .conditions = "1.8 V, the sets' loads",
             .status = ClaimStatus::kDisagrees,
             .reason =
                 "dead time takes 2 to 3 % of the field, so the same load needs one count "
                 "more; a load as much smaller makes it 37 again"};
  for (const SetResult& set : sets) dead.simulated.push_back(set.critical_dead_time);
  if (std::all_of(dead.simulated.begin(), dead.simulated.end(), [](double n) { return n == 37; }))
    dead.status = ClaimStatus::kFitted;
  add(std::move(dead));

  Claim margin{.id = "n_margin",
               .text = "n 108 is nearly twice the margin over the critical n",
               .paper = {2},
               .unit = "(108 - n) / n by set",
               .conditions = "1.8 V"};
  for (const SetResult& set : sets)
    margin.simulated.push_back((kFinalRepeat - set.critical) / static_cast<double>(set.critical));
  const auto near_two = [](const std::vector<double>& numbers) {
    return std::all_of(numbers.begin(), numbers.end(), [](double x) { return x > 1.6 && x < 2.4; })
               ? ClaimStatus::kReproduced
               : ClaimStatus::kDisagrees;
  };
  margin.status = near_two(margin.simulated);
  add(std::move(margin));
  torque.status = near_two(torque.simulated);
  add(std::move(torque));

  // The paper's outlook is that a ramp lets a load start with a smaller n, so that its move is
  // shorter.
  progress(0.91, "ramps");
  constexpr Ramp kRamp{.stages = 8, .stage_s = 0.02};
  Claim heat{
      .id = "ramp_heat",
      .text = "a curve of acceleration and deceleration can decrease the heat loss",
      .unit = "% of the copper loss of 12 moves at the critical n without it, by set; then n",
      .conditions = "1.8 V, ideal bridge, 8 stages of 20 ms at each end"};
  std::vector<double> with_ramp;
  for (const SetResult& set : sets) {
    const auto copper_J = [&](int repeat, const Ramp& ramp) {
      const MoveCount count =
          TryMoves(set.at_1V8, {.repeat = repeat}, {.ramp = ramp}, DriveLevel::kReduced);
      return count.all() ? count.copper_J : std::nan("");
    };
    const int repeat =
        CriticalRepeat(set.at_1V8, {}, {.ramp = kRamp}, DriveLevel::kReduced).value_or(0);
    with_ramp.push_back(repeat);
    heat.simulated.push_back(repeat == 0 || set.critical == 0
                                 ? std::nan("")
                                 : 100 * copper_J(repeat, kRamp) / copper_J(set.critical, {}));
  }
  heat.status = std::all_of(heat.simulated.begin(), heat.simulated.end(),
                            [](double percent) { return percent < 100; })
                    ? ClaimStatus::kReproduced
                    : ClaimStatus::kDisagrees;
  heat.reason = "a set did not make all twelve moves, or warmed more";
  heat.simulated.insert(heat.simulated.end(), with_ramp.begin(), with_ramp.end());
  add(std::move(heat));

  // The bench point is a bare motor from rest at 9 V with n 8.
  progress(0.92, "bare motor at 9 V");
  Claim bare{.id = "bare_motor_9V",
             .text = "a bare motor starts at 9 V with n 8",
             .paper = {8},
             .unit = "critical n by flux 0.15, 0.20, 0.25, 0.30, 0.40 mWb",
             .conditions = "load 1 uNm, no drag, from rest without a ramp"};
  for (const double flux_mWb : {0.15, 0.20, 0.25, 0.30, 0.40}) {
    auto setting = Ideal(PaperSetting(options, "C", 9));
    setting.motor.flux_linkage_Wb = 1e-3 * flux_mWb;
    setting.motor.load_Nm = kBareLoad_Nm;
    bare.simulated.push_back(CriticalRepeatReal(setting, {}).value_or(std::nan("")));
  }
  const bool some =
      std::any_of(bare.simulated.begin(), bare.simulated.end(), [](double n) { return n <= 8; });
  bare.status = some ? ClaimStatus::kFitted : ClaimStatus::kDisagrees;
  bare.reason =
      "parameter: flux linkage; a weaker magnet would not have come up. Loaded, no set "
      "starts at 9 V with n 8 (n " +
      std::to_string(std::lround(loaded_9V)) + " at best)";
  add(std::move(bare));
}

}  // namespace focalfleet::sim::reproduction
