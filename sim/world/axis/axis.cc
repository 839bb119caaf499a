#include "sim/world/axis/axis.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numbers>

#include "protocol/base/check.h"

namespace focalfleet::sim {
namespace {

double SinDeg(double deg) { return std::sin(deg * std::numbers::pi / 180); }

AxisMemory Fresh(const AxisModel::Start& start) {
  const double turns = static_cast<double>(start.position) / start.subdivision;
  // The factory sets zero where the unit stands now. An error of the gear shows on the way from
  // here.
  const double output_deg = turns * 360 / start.believed_gear;
  return {.rotor_turns = turns,
          .output_deg = output_deg,
          .rotor_reference_turns = turns,
          .output_reference_deg = output_deg};
}

}  // namespace

AxisModel::AxisModel(const AxisTraits& traits, const Motor* motor, const Start& start)
    : AxisModel(traits, motor, Fresh(start)) {}

AxisModel::AxisModel(const AxisTraits& traits, const Motor* motor, const AxisMemory& memory)
    : traits_(traits), motor_(motor), memory_(memory), next_scatter_deg_(memory.scatter_deg) {
  if (traits_.grip <= 0) return;  // nothing arrives at the output: the rotor turns for ever
  const auto turns_at = [&](double output_deg) {
    return memory_.rotor_reference_turns +
           (output_deg - memory_.output_reference_deg) * traits_.gear / (360 * traits_.grip);
  };
  stop_low_turns_ = turns_at(traits_.stop_low_deg - traits_.backlash_deg / 2);
  stop_high_turns_ = turns_at(traits_.stop_high_deg + traits_.backlash_deg / 2);
}

void AxisModel::Energise(const Field& field) {
  subdivision_ = field.subdivision;
  path_ = FieldPath(field.position);
  Moment moment{memory_.rotor_turns, memory_.output_deg, offset_turns_};
  LockOn(static_cast<double>(field.position) / subdivision_, &moment);
  memory_.rotor_turns = moment.rotor_turns;
  memory_.output_deg = moment.output_deg;
  offset_turns_ = moment.offset_turns;
}

void AxisModel::Run(const FieldPath& path) {
  path_ = path;
  if (path.pieces().empty() || traits_.scatter_deg <= 0 || traits_.grip <= 0) return;
  Rng rng = Rng::Stream(traits_.scatter_seed, "scatter", ++memory_.moves);
  const double kept = std::exp(-WayDeg() / kScatterTravelDeg);
  next_scatter_deg_ =
      kept * memory_.scatter_deg + traits_.scatter_deg * std::sqrt(1 - kept * kept) * rng.Normal();
}

void AxisModel::Halt(HostInstant at) { Fold(at, true); }

void AxisModel::Release(HostInstant at) { Fold(at, false); }

void AxisModel::Recount(std::int32_t position) {
  const std::int32_t difference = path_.to() - position;
  FOCALFLEET_CHECK(path_.pieces().empty() && difference % subdivision_ == 0);
  offset_turns_ += difference / subdivision_;
  path_ = FieldPath(position);
}

double AxisModel::AngleDeg(HostInstant at) const {
  const double output_deg = At(at, false).output_deg;
  const double wobble = SinDeg(output_deg + traits_.periodic_phase_deg) -
                        SinDeg(memory_.output_reference_deg + traits_.periodic_phase_deg);
  return output_deg + traits_.periodic_deg * wobble + ScatterDeg(at);
}

AxisMemory AxisModel::Memory(HostInstant at) const {
  AxisModel copy = *this;
  copy.Fold(at, false);
  return copy.memory_;
}

void AxisModel::Fold(HostInstant at, bool settled) {
  const std::int32_t applied = path_.Applied(at);
  const Moment moment = At(at, settled);
  memory_.scatter_deg = next_scatter_deg_ = ScatterDeg(at);
  memory_.rotor_turns = moment.rotor_turns;
  memory_.output_deg = moment.output_deg;
  offset_turns_ = moment.offset_turns;
  path_ = FieldPath(applied);
}

AxisModel::Moment AxisModel::At(HostInstant at, bool settled) const {
  Moment moment{memory_.rotor_turns, memory_.output_deg, offset_turns_};
  if (path_.pieces().empty()) return moment;
  const double now_ns = path_.UnitNs(at);
  for (const FieldPath::Piece& piece : path_.pieces()) {
    if (now_ns < piece.begin_ns) break;
    FollowPiece(piece, now_ns, settled, &moment);
  }
  return moment;
}

void AxisModel::FollowPiece(const FieldPath::Piece& piece, double now_ns, bool settled,
                            Moment* moment) const {
  if (piece.delta == 0) return;
  const double total = std::abs(piece.delta);
  double shown = std::min(total, (now_ns - piece.begin_ns) / piece.ns_per_vector);
  if (settled) shown = std::min(total, std::floor(shown) + 1);
  const double field_turns =
      (piece.from + (piece.delta < 0 ? -shown : shown)) / static_cast<double>(subdivision_);
  const double turns_per_s = 1e9 / (piece.ns_per_vector * subdivision_);
  if (!motor_->Follows(turns_per_s)) {
    // The rotor trembles where it stood; only a field at rest catches it again.
    if (shown >= total || settled) LockOn(field_turns, moment);
    return;
  }
  double extra = 0;
  if (!settled) {
    const double share = LoadShare(field_turns + static_cast<double>(moment->offset_turns));
    const double settling_ns = motor_->settling_s() * 1e9;
    const double ran_ns = std::min(now_ns, piece.end_ns()) - piece.begin_ns;
    const double since_ns = std::max(0.0, now_ns - piece.end_ns());
    extra = (motor_->RunningLagTurns(turns_per_s, share) - motor_->StaticLagTurns(share)) *
            (1 - std::exp(-ran_ns / settling_ns)) * std::exp(-since_ns / settling_ns);
  }
  Drag({field_turns, extra, piece.delta > 0}, moment);
}

// A monotone turn of the field goes upwards or downwards by the sign of the way from its begin. The
// friction band is a max (or min) with the rotor's former place. Against a hard stop the field runs
// ahead, and after half a turn the rotor belongs to the turn below.
void AxisModel::Drag(const Pull& pull, Moment* moment) const {
  // The downward case is the upward case in a mirror.
  const double sign = pull.up ? 1 : -1;
  const double stop = sign * (pull.up ? stop_high_turns_ : stop_low_turns_);
  double field = sign * (pull.field_turns + static_cast<double>(moment->offset_turns));
  const double lag = motor_->StaticLagTurns(LoadShare(sign * field)) + pull.extra_lag_turns;
  double rotor = std::max(sign * moment->rotor_turns, field - lag);
  if (field - lag > stop) {
    const double slipped = std::max(0.0, std::ceil(field - stop - 0.5));
    moment->offset_turns -= static_cast<std::int64_t>(sign * slipped);
    field -= slipped;
    rotor = std::min(stop, field - lag);
  }
  Turn(sign * rotor, moment);
}

// The rotor turns by less than half a turn to agree with a field at rest.
void AxisModel::LockOn(double field_turns, Moment* moment) const {
  moment->offset_turns = std::llround(moment->rotor_turns - field_turns);
  const double agreed = field_turns + static_cast<double>(moment->offset_turns);
  const double lag = motor_->StaticLagTurns(LoadShare(agreed));
  const double rotor = std::clamp(moment->rotor_turns, agreed - lag, agreed + lag);
  Turn(std::clamp(rotor, stop_low_turns_, stop_high_turns_), moment);
}

double AxisModel::DrivenDeg(double rotor_turns) const {
  return memory_.output_reference_deg +
         (rotor_turns - memory_.rotor_reference_turns) * 360 * traits_.grip / traits_.gear;
}

void AxisModel::Turn(double rotor_turns, Moment* moment) const {
  moment->rotor_turns = rotor_turns;
  const double driven_deg = DrivenDeg(rotor_turns);
  const double half = traits_.backlash_deg / 2;
  moment->output_deg = std::clamp(moment->output_deg, driven_deg - half, driven_deg + half);
}

// The load is taken where a rotor without lag would stand. The load varies over a whole output
// turn, so the lag makes no difference to it.
double AxisModel::LoadShare(double rotor_turns) const {
  return 1 + motor_->parameters().load_variation *
                 SinDeg(DrivenDeg(rotor_turns) + traits_.load_phase_deg);
}

double AxisModel::WayDeg() const {
  double vectors = 0;
  for (const FieldPath::Piece& piece : path_.pieces()) vectors += std::abs(piece.delta);
  return vectors * 360 / (subdivision_ * traits_.gear);
}

double AxisModel::ScatterDeg(HostInstant at) const {
  if (next_scatter_deg_ == memory_.scatter_deg) return memory_.scatter_deg;
  double way = 0;
  for (const FieldPath::Piece& piece : path_.pieces()) way += std::abs(piece.delta);
  if (way <= 0) return memory_.scatter_deg;
  double gone = 0;
  const double now_ns = path_.UnitNs(at);
  for (const FieldPath::Piece& piece : path_.pieces())
    gone += std::clamp((now_ns - piece.begin_ns) / piece.ns_per_vector, 0.0,
                       static_cast<double>(std::abs(piece.delta)));
  return memory_.scatter_deg + (next_scatter_deg_ - memory_.scatter_deg) * gone / way;
}

}  // namespace focalfleet::sim
