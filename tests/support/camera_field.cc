#include "tests/support/camera_field.h"

#include <algorithm>
#include <cmath>

#include "fleet/targets.h"

namespace focalfleet::test {
namespace {

constexpr double kAlikeMm = 0.7;  // twice the widest gate

std::complex<double> Complex(PointFp p) { return {p.x_mm, p.y_mm}; }

sim::Mechanism MechanismOf(const Unit& unit) {
  sim::Mechanism mechanism;
  mechanism.base_mm = Complex(unit.base_fp);
  for (std::size_t k = 0; k < kAxisCount; ++k) {
    mechanism.arm_mm[k] = unit.axis[k].arm_mm;
    mechanism.zero_deg[k] = unit.axis[k].zero_deg;
  }
  return mechanism;
}

Layout MadeLayout(std::vector<Unit> units, Rng* rng) {
  // Each unit has a zero angle of its own, so a command means another direction at each unit.
  for (Unit& unit : units) unit.axis[0].zero_deg = rng->Uniform(-180, 180);
  return *Layout::Create(std::move(units), {});
}

}  // namespace

CameraField::CameraField(const HexLayoutOptions& options, std::uint64_t seed)
    : rng_(Rng::Stream(seed, "camera field")),
      layout_(MadeLayout(MakeHexPlate(options).units, &rng_)),
      fiducials_(MakeHexPlate(options).fiducials),
      units_(layout_.size()) {
  for (const Unit& unit : layout_.units()) mechanisms_.push_back(MechanismOf(unit));
  const std::vector<AxisAngles> first = DrawAngles(true);
  for (std::uint32_t i = 0; i < units_.size(); ++i) {
    units_[i].commanded = first[i];
    units_[i].place_mm = PlaceOf(i, first[i]);
  }
}

std::complex<double> CameraField::PlaceOf(std::uint32_t unit, const AxisAngles& angles) const {
  return sim::FibreAt(mechanisms_[unit], {angles.theta_deg, angles.phi_deg});
}

std::vector<AxisAngles> CameraField::DrawAngles(bool collision_free) {
  std::vector<AxisAngles> angles;
  const std::vector<UnitDrive> drives(layout_.size());
  if (collision_free) {
    const std::vector<std::optional<Pose>> anywhere(layout_.size());
    const auto poses = DrawConfiguration(layout_, drives, anywhere, Rng(rng_.Bits()));
    for (std::uint32_t i = 0; poses && i < layout_.size(); ++i)
      angles.push_back(AnglesOf(layout_.unit({i}), drives[i], (*poses)[i]));
    if (poses) return angles;
  }
  for (const Unit& unit : layout_.units())
    angles.push_back({rng_.Uniform(unit.theta().min_deg, unit.theta().max_deg),
                      rng_.Uniform(unit.phi().min_deg, unit.phi().max_deg)});
  return angles;
}

void CameraField::Move(const FieldTroubles& troubles) {
  const std::vector<AxisAngles> next = DrawAngles(troubles.collision_free);
  for (std::uint32_t i = 0; i < units_.size(); ++i) {
    // The loop had brought every unit to its place before.
    const AxisAngles before = units_[i].commanded;
    const std::complex<double> noise(troubles.corrected_sigma_mm * rng_.Normal(),
                                     troubles.corrected_sigma_mm * rng_.Normal());
    units_[i] = {};
    units_[i].before = before;
    units_[i].commanded = next[i];
    units_[i].before_mm = PlaceOf(i, before) + noise;
    units_[i].place_mm = PlaceOf(i, before);
  }
  PlantFates(troubles);
  DrawSwaps(troubles);
  for (std::uint32_t i = 0; i < units_.size(); ++i) {
    PlantedUnit& unit = units_[i];
    const AxisAngles reported =
        unit.fate == PlantedFate::kSwapped ? units_[unit.swapped_with].commanded : unit.commanded;
    const double tail = rng_.Uniform() < troubles.tail_share ? rng_.Uniform(3, 30) : 1;
    const double share[] = {unit.fate == PlantedFate::kSlipping ? rng_.Uniform() : 1,
                            unit.fate == PlantedFate::kSlipping ? rng_.Uniform() : 1};
    const double from[] = {unit.before.theta_deg, unit.before.phi_deg};
    const double to[] = {reported.theta_deg, reported.phi_deg};
    double ends[2];
    for (std::size_t k = 0; k < kAxisCount; ++k) {
      const double error = tail * troubles.blind_sigma_deg * rng_.Normal();
      ends[k] = unit.stayed[k] ? from[k] : from[k] + share[k] * (to[k] - from[k]) + error;
    }
    unit.place_mm = PlaceOf(i, {ends[0], ends[1]});
    // Disabled units receive no command.
    if (unit.fate == PlantedFate::kDisabled) unit.commanded = unit.before;
  }
}

void CameraField::PlantFates(const FieldTroubles& troubles) {
  for (PlantedUnit& unit : units_) {
    const double chance = rng_.Uniform();
    const double dead = troubles.dead_share;
    if (chance < dead) {
      unit.fate = PlantedFate::kDead;
      unit.stayed = {chance < dead * 5 / 6, chance < dead * 2 / 3 || chance > dead * 5 / 6};
    } else if (chance < dead + troubles.slipping_share) {
      unit.fate = PlantedFate::kSlipping;
    } else if (chance < dead + troubles.slipping_share + troubles.disabled_share) {
      unit.fate = PlantedFate::kDisabled;
      unit.stayed = {true, true};
    }
  }
}

void CameraField::DrawSwaps(const FieldTroubles& troubles) {
  int planted = 0;
  for (int tries = 0; planted < troubles.swaps && tries < 100 * troubles.swaps; ++tries) {
    const auto a = static_cast<std::uint32_t>(rng_.Below(units_.size()));
    const auto near = layout_.neighbours({a});
    const auto b = planted % 2 == 0 && !near.empty()
                       ? near[rng_.Below(near.size())].value
                       : static_cast<std::uint32_t>(rng_.Below(units_.size()));
    if (a == b || units_[a].fate != PlantedFate::kHealthy ||
        units_[b].fate != PlantedFate::kHealthy)
      continue;
    units_[a].fate = units_[b].fate = PlantedFate::kSwapped;
    units_[a].swapped_with = b;
    units_[b].swapped_with = a;
    ++planted;
  }
}

std::vector<sim::LightSource> CameraField::Sources() const {
  std::vector<sim::LightSource> sources;
  for (std::uint32_t i = 0; i < units_.size(); ++i)
    sources.push_back({sim::LightKind::kFibre, layout_.unit({i}).id.value, units_[i].place_mm, 1});
  for (const Fiducial& fiducial : fiducials_)
    sources.push_back({sim::LightKind::kFiducial, fiducial.id, Complex(fiducial.at_fp), 1});
  return sources;
}

std::vector<UnitExpectation> CameraField::Expectations() const {
  std::vector<UnitExpectation> expectations;
  for (std::uint32_t i = 0; i < units_.size(); ++i) {
    const PointFp seen{units_[i].before_mm.real(), units_[i].before_mm.imag()};
    if (units_[i].fate == PlantedFate::kDisabled) {
      expectations.push_back(ExpectStill(seen, 0.005));
    } else {
      expectations.push_back(
          ExpectMove(layout_.unit({i}), units_[i].before, units_[i].commanded, BlindError{}));
      expectations.back().before_fp = seen;
      expectations.back().before_sigma_mm = 0.005;
    }
    expectations.back().flux = 1;
  }
  return expectations;
}

sim::CameraTraits TestCamera(double rim_mm) {
  sim::CameraTraits traits;
  const double half_px = 5 * (rim_mm + 60);
  traits.optics = {.pixels_per_mm = 5,
                   .rotation_deg = 3,
                   .centre_px = {half_px, half_px},
                   .mirrored = true,
                   .radius_mm = 1000,
                   .radial3 = 8e-4,
                   .radial5 = -2e-4,
                   .decentring = {3e-5, -2e-5},
                   .twist = 5e-5};
  traits.sensor_px = {2 * half_px, 2 * half_px};
  traits.air = {.sigma_mm = 0.008, .length_mm = 150};
  traits.flux_scatter = 0.1;
  traits.fwhm_scatter = 0.03;
  traits.missing_share = 0.01;
  traits.extra_share = 0.005;
  traits.scale_change_ppm = 100;
  traits.rotation_change_deg = 0.005;
  traits.shift_change_px = 2;
  return traits;
}

CameraModel ModelOf(const sim::CameraTraits& traits) {
  return {.pixels_per_mm = traits.optics.pixels_per_mm,
          .rotation_deg = traits.optics.rotation_deg,
          .centre_x_px = traits.optics.centre_px.real(),
          .centre_y_px = traits.optics.centre_px.imag(),
          .mirrored = traits.optics.mirrored,
          .radius_mm = traits.optics.radius_mm,
          .distortion = {}};
}

Exposure ExposureOf(const sim::Image& image, std::string id) {
  Exposure exposure;
  exposure.id = std::move(id);
  for (std::uint32_t k = 0; k < image.spots.size(); ++k) {
    const sim::ImageSpot& spot = image.spots[k];
    exposure.spots.push_back({k, spot.x_px, spot.y_px, spot.flux, spot.fwhm_px});
  }
  return exposure;
}

namespace {

class Judging {
 public:
  Judging(const CameraField& field, const sim::Image& image, const Identification& result)
      : field_(field), image_(image), result_(result), visible_(field.units().size(), 0) {
    for (const std::vector<std::uint32_t>& light : image.light)
      for (const std::uint32_t source : light)
        if (light.size() == 1 && source < visible_.size()) visible_[source] = 1;
  }

  Judgement Run() {
    judgement_.count = result_.count;
    for (std::uint32_t i = 0; i < result_.units.size(); ++i) JudgeUnit(i);
    for (std::uint32_t i = 0; i < result_.units.size(); ++i)
      if (field_.units()[i].fate == PlantedFate::kSwapped && field_.units()[i].swapped_with > i)
        JudgePair(i, field_.units()[i].swapped_with);
    return judgement_;
  }

 private:
  void JudgeUnit(std::uint32_t i) {
    const UnitMeasurement& said = result_.units[i];
    const PlantedUnit& truth = field_.units()[i];
    if (!IsCertain(said.status) && visible_[i] != 0 && truth.fate == PlantedFate::kHealthy)
      ++judgement_.lost;
    if (said.spot == kNoSpot) return;
    const std::vector<std::uint32_t>& light = image_.light[said.spot];
    const bool its = std::find(light.begin(), light.end(), i) != light.end();
    if (!its) {
      ++(IsCertain(said.status) ? judgement_.wrong : judgement_.flagged_wrong);
      return;
    }
    if (!IsCertain(said.status)) return;
    if (!StoryHolds(i, said)) ++judgement_.wrong_story;
    if (light.size() > 1) return;
    const double dx = said.at_fp.x_mm - truth.place_mm.real();
    const double dy = said.at_fp.y_mm - truth.place_mm.imag();
    judgement_.squared_mm2 += dx * dx + dy * dy;
    judgement_.squared_sigmas += (dx * dx / said.covariance.xx + dy * dy / said.covariance.yy) / 2;
    ++judgement_.placed;
  }

  [[nodiscard]] bool StoryHolds(std::uint32_t i, const UnitMeasurement& said) const {
    const PlantedUnit& truth = field_.units()[i];
    if (said.status == MeasurementStatus::kSwapped)
      return truth.fate == PlantedFate::kSwapped && said.other.value == truth.swapped_with;
    if (said.status == MeasurementStatus::kDidNotMove) return said.stayed == truth.stayed;
    // The unit is where its move ends, whatever brought it there.
    return std::abs(field_.PlaceOf(i, truth.commanded) - truth.place_mm) < kAlikeMm ||
           !said.motion_is_known;
  }

  void JudgePair(std::uint32_t a, std::uint32_t b) {
    ++judgement_.pairs;
    const auto names = [this](std::uint32_t unit, std::uint32_t other) {
      return result_.units[unit].status == MeasurementStatus::kSwapped &&
             result_.units[unit].other.value == other;
    };
    const auto alike = [this](std::uint32_t unit) {
      return std::abs(field_.PlaceOf(unit, field_.units()[unit].commanded) -
                      field_.units()[unit].place_mm) < kAlikeMm;
    };
    const auto suspects = [this](std::uint32_t unit, std::uint32_t other) {
      return result_.units[unit].status == MeasurementStatus::kSwapSuspected &&
             result_.units[unit].other.value == other;
    };
    if (suspects(a, b) || suspects(b, a)) ++judgement_.pairs_suspected;
    if (names(a, b) && names(b, a)) {
      ++judgement_.pairs_found;
    } else if (visible_[a] == 0 || visible_[b] == 0) {
      ++judgement_.pairs_dark;
    } else if (alike(a) || alike(b)) {
      ++judgement_.pairs_alike;
    } else if (!IsCertain(result_.units[a].status) && !IsCertain(result_.units[b].status)) {
      ++judgement_.pairs_flagged;
    } else {
      ++judgement_.pairs_unseen;
    }
  }

  const CameraField& field_;
  const sim::Image& image_;
  const Identification& result_;
  std::vector<char> visible_;  // gives light, alone in its spot
  Judgement judgement_;
};

}  // namespace

Judgement Judge(const CameraField& field, const sim::Image& image, const Identification& result) {
  return Judging(field, image, result).Run();
}

}  // namespace focalfleet::test
