#include "tests/hidden/generator/measure.h"

#include <algorithm>
#include <cmath>

namespace focalfleet::hidden {

namespace {

double HeavyTailed(double freedom, Rng* rng) {
  const double normal = rng->Normal();
  if (freedom <= 0) return normal;
  const int n = static_cast<int>(std::round(freedom));
  double sum = 0;
  for (int i = 0; i < n; ++i) {
    const double part = rng->Normal();
    sum += part * part;
  }
  return normal / std::sqrt(sum / n) * std::sqrt((n - 2.0) / n);  // variance 1
}

// A random field over the plate that changes from picture to picture with memory of the last.
class Air {
 public:
  Air(const Campaign& campaign, Rng* rng) : rng_(rng) {
    for (Place& wave : wave_)
      wave = Place(rng->Normal(), rng->Normal()) / (0.6 * campaign.plate_radius_mm);
    for (Place& part : part_) part = {rng->Normal(), rng->Normal()};
    for (Place& part : other_) part = {rng->Normal(), rng->Normal()};
  }
  void Next(double memory) {
    const double fresh = std::sqrt(1 - memory * memory);
    for (std::size_t w = 0; w < wave_.size(); ++w) {
      part_[w] = memory * part_[w] + fresh * Place(rng_->Normal(), rng_->Normal());
      other_[w] = memory * other_[w] + fresh * Place(rng_->Normal(), rng_->Normal());
    }
  }
  [[nodiscard]] Place At(const Place& place_mm) const {
    Place sum;
    for (std::size_t w = 0; w < wave_.size(); ++w) {
      const double along = (std::conj(wave_[w]) * place_mm).real();
      sum += part_[w] * std::cos(along) + other_[w] * std::sin(along);
    }
    return sum / std::sqrt(static_cast<double>(wave_.size()));
  }

 private:
  Rng* rng_;
  std::array<Place, 16> wave_{};
  std::array<Place, 16> part_{};
  std::array<Place, 16> other_{};
};

class Recorder {
 public:
  Recorder(const Spec& spec, const Scene& scene, Measurement* out)
      : spec_(spec), n_(spec.nuisances), campaign_(*scene.campaign), out_(out) {}

  void Noise() {
    Rng rng = Rng::Stream(spec_.seed, "camera noise");
    const std::size_t units = campaign_.unit_count();
    out_->noise.centroid_um.resize(units);
    for (double& sigma : out_->noise.centroid_um)
      sigma = spec_.centroid_um * std::exp(n_.unit_spread * rng.Normal());
    for (std::size_t m = 0; m < campaign_.move_count(); ++m) {
      const double picture = std::exp(n_.picture_spread * rng.Normal());
      for (std::size_t u = 0; u < units; ++u) {
        const double sigma_mm = out_->noise.centroid_um[u] * picture / 1000;
        const double x = HeavyTailed(n_.tail_freedom, &rng);
        const double y = HeavyTailed(n_.tail_freedom, &rng);
        out_->place_mm[m * units + u] += sigma_mm * Place(x, y);
      }
    }
  }

  void AirAndNight() {
    Rng rng = Rng::Stream(spec_.seed, "air");
    const std::size_t units = campaign_.unit_count();
    Air air(campaign_, &rng);
    const Place shift = n_.night_shift_um / 1000 * std::polar(1.0, rng.Uniform(0, 2 * kPi));
    for (std::size_t m = 0; m < campaign_.move_count(); ++m) {
      air.Next(n_.turbulence_memory);
      for (std::size_t u = 0; u < units; ++u) {
        Place& place = out_->place_mm[m * units + u];
        if (n_.turbulence_um > 0) place += n_.turbulence_um / 1000 * air.At(place);
        if (2 * m >= campaign_.move_count()) place += shift;
      }
    }
    if (n_.turbulence_um > 0) Allow({"air_turbulence", "camera_similarity"});
    if (n_.night_shift_um > 0) Allow({"camera_similarity"});
  }

  void Units() {
    Rng rng = Rng::Stream(spec_.seed, "troubled units");
    const std::size_t units = campaign_.unit_count();
    for (int i = 0; i < n_.stuck_units && units > 8; ++i) {
      const std::size_t u = rng.Below(units);
      for (std::size_t m = 0; m < campaign_.move_count(); ++m) {
        out_->counts[m * units + u] = 0;
        if (m > 0)
          out_->place_mm[m * units + u] = out_->place_mm[u] + out_->noise.centroid_um[u] / 1000 *
                                                                  Place(rng.Normal(), rng.Normal());
      }
      Trouble(u);
    }
    for (int i = 0; i < n_.swapped_pairs && units > 8; ++i) {
      const std::size_t a = rng.Below(units);
      const std::size_t b = (a + 1 + rng.Below(units - 1)) % units;
      for (std::size_t m = 0; m < campaign_.move_count(); ++m)
        std::swap(out_->place_mm[m * units + a], out_->place_mm[m * units + b]);
      Trouble(a);
      Trouble(b);
      Allow({"identity_swap"});
    }
    for (int i = 0; i < n_.wrapped_units; ++i) Wrap(rng.Below(units), &rng);
  }

  void Rows() {
    Rng rng = Rng::Stream(spec_.seed, "troubled rows");
    for (std::size_t r = 0; r < out_->place_mm.size(); ++r) {
      if (rng.Uniform() < n_.outlier_share) {
        const bool other_spot = rng.Uniform() < 0.2;
        const double size_mm = other_spot ? rng.Uniform(0.5, 8) : rng.Uniform(0.03, 0.3);
        out_->place_mm[r] += std::polar(size_mm, rng.Uniform(0, 2 * kPi));
        out_->bad[r] = 1;
      }
      if (rng.Uniform() < n_.missing_share) out_->seen[r] = out_->counts[r] = 0;
      for (std::uint32_t cell = 0; cell < 20; ++cell)
        if (rng.Uniform() < n_.missing_cells) out_->blank[r] |= 1u << cell;
    }
  }

 private:
  void Allow(const std::vector<std::string>& causes) {
    for (const std::string& cause : causes)
      if (std::find(out_->also_true.begin(), out_->also_true.end(), cause) == out_->also_true.end())
        out_->also_true.push_back(cause);
  }
  void Trouble(std::size_t unit) {
    out_->troubled_unit_ids.push_back(campaign_.units[unit].id);
    for (std::size_t m = 0; m < campaign_.move_count(); ++m)
      out_->bad[m * campaign_.unit_count() + unit] = 1;
  }
  // A few commands of one unit are logged a whole turn off; the unit went to the right place.
  void Wrap(std::size_t unit, Rng* rng) {
    const std::size_t units = campaign_.unit_count();
    const std::size_t from = 1 + rng->Below(campaign_.move_count() - 1);
    const std::size_t count = 1 + rng->Below(4);
    const double turn_deg = rng->Uniform() < 0.5 ? 360 : -360;
    for (std::size_t m = from; m < std::min(from + count, campaign_.move_count()); ++m) {
      out_->reported_cmd_deg[m * units + unit][kTheta] += turn_deg;
      out_->reported_from_deg[m * units + unit][kTheta] += m > from ? turn_deg : 0;
    }
  }

  const Spec& spec_;
  const Nuisances& n_;
  const Campaign& campaign_;
  Measurement* out_;
};

}  // namespace

Truth DrawTruth(const Spec& spec, const Campaign& campaign) {
  Rng rng = Rng::Stream(spec.seed, "geometry");
  Truth truth;
  truth.seed = spec.seed;
  const StaticErrors& e = spec.static_errors;
  for (const Unit& unit : campaign.units) {
    Geometry g = unit.believed;
    g.base_mm += e.base_um / 1000 * Place(rng.Normal(), rng.Normal());
    for (std::size_t a = 0; a < kAxes; ++a) {
      g.arm_mm[a] += e.arm_um / 1000 * rng.Normal();
      g.zero_deg[a] += e.zero_deg * rng.Normal();
    }
    truth.geometry.push_back(g);
  }
  const Geometry& one = campaign.units[0].believed;
  for (std::size_t a = 0; a < kAxes; ++a)
    truth.actuation_sigma_deg[a] = spec.actuation_um / 1000 / one.arm_mm[a] / kDegree;
  return truth;
}

Measurement Measure(const Spec& spec, const Scene& scene, const Truth& truth,
                    const std::vector<Effect>& effects) {
  const Campaign& campaign = *scene.campaign;
  const std::size_t units = campaign.unit_count();
  const std::size_t rows = campaign.rows.size();
  std::vector<Effect> moving;
  for (const Effect& effect : effects)
    if (effect.kind->cause != "sensor_bias") moving.push_back(effect);
  const auto places = RunPlant(scene, truth, moving, AllUnits(campaign));
  Measurement out;
  out.place_mm.resize(rows);
  out.seen.resize(rows);
  out.counts.resize(rows);
  out.bad.assign(rows, 0);
  out.blank.assign(rows, 0);
  out.reported_from_deg.resize(rows);
  out.reported_cmd_deg.resize(rows);
  out.reported_temp_C.resize(rows);
  out.noise.actuation_deg = truth.actuation_sigma_deg;
  for (std::size_t r = 0; r < rows; ++r) {
    const Row& row = campaign.rows[r];
    out.place_mm[r] = places[r % units][r / units];
    out.seen[r] = out.counts[r] = row.exposed ? 1 : 0;
    out.reported_from_deg[r] = row.from_deg;
    out.reported_cmd_deg[r] = row.cmd_deg;
    out.reported_temp_C[r] = row.temp_C;
    for (const Effect& effect : effects)
      if (effect.kind->cause == "sensor_bias")
        out.reported_temp_C[r] += effect.Amount(r % units) * (row.temp_C - campaign.temp_mean_C);
  }
  Recorder recorder(spec, scene, &out);
  recorder.Noise();
  recorder.AirAndNight();
  recorder.Units();
  recorder.Rows();
  return out;
}

}  // namespace focalfleet::hidden
