// This bench assigns spots of whole focal planes to units: random exposures with all planted
// defects that real ones have, judged by the simulator's truth. The bench prints wrong matches that
// are not flagged, swaps found, position errors and CPU time. The exit code is 1 where a match is
// wrong and not flagged, or where a visible swap passed for something else.
//   identify_bench --units 5000 --fiducials 120 --exposures 1000 --seed 1 --swaps 20 --air-um 8
//                  --length-mm 150 --crowded 0
// The calibration loop is a million draws of Rng::Normal: CPU times are to be read beside it.
#include <algorithm>
#include <cmath>
#include <ctime>

#include "tests/bench/options.h"
#include "tests/support/camera_field.h"

namespace focalfleet {
namespace {

using bench::Median;
using bench::Option;
using test::CameraField;
using test::FieldTroubles;
using test::Judgement;

double CpuMs() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) * 1e3 + static_cast<double>(t.tv_nsec) * 1e-6;
}

double CalibrationMs() {
  const double begin = CpuMs();
  Rng rng(1);
  double sum = 0;
  for (int k = 0; k < 1'000'000; ++k) sum += rng.Normal();
  const double ms = CpuMs() - begin;
  return sum == 0 ? 0 : ms;
}

void Add(const Judgement& one, Judgement* all) {
  for (std::size_t k = 0; k < one.count.size(); ++k) all->count[k] += one.count[k];
  all->wrong += one.wrong;
  all->wrong_story += one.wrong_story;
  all->flagged_wrong += one.flagged_wrong;
  all->lost += one.lost;
  all->pairs += one.pairs;
  all->pairs_found += one.pairs_found;
  all->pairs_dark += one.pairs_dark;
  all->pairs_alike += one.pairs_alike;
  all->pairs_flagged += one.pairs_flagged;
  all->pairs_suspected += one.pairs_suspected;
  all->pairs_unseen += one.pairs_unseen;
  all->squared_mm2 += one.squared_mm2;
  all->squared_sigmas += one.squared_sigmas;
  all->placed += one.placed;
}

double Quantile(std::vector<double> values, double q) {
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(q * static_cast<double>(values.size() - 1))];
}

int Run(int argc, char** argv) {
  const int units = Option(argc, argv, "--units", 5000);
  const int exposures = Option(argc, argv, "--exposures", 1000);
  const int seed = Option(argc, argv, "--seed", 1);
  FieldTroubles troubles;
  troubles.swaps = Option(argc, argv, "--swaps", 20);
  troubles.collision_free = Option(argc, argv, "--crowded", 0) == 0;
  CameraField field(
      {.count = static_cast<std::uint32_t>(units),
       .fiducials = static_cast<std::uint32_t>(Option(argc, argv, "--fiducials", 120))},
      static_cast<std::uint64_t>(seed));
  double rim_mm = 0;
  for (const Unit& unit : field.layout().units())
    rim_mm = std::max(rim_mm, std::hypot(unit.base_fp.x_mm, unit.base_fp.y_mm));
  sim::CameraTraits traits = test::TestCamera(rim_mm);
  traits.air = {.sigma_mm = Option(argc, argv, "--air-um", 8) * 1e-3,
                .length_mm = static_cast<double>(Option(argc, argv, "--length-mm", 150))};
  const CameraModel model = test::ModelOf(traits);

  Judgement all;
  int refused = 0;
  std::vector<double> cpu_ms;
  std::vector<double> calibration_ms;
  double air_mm = 0;
  double length_mm = 0;
  double residual_mm = 0;
  for (int k = 0; k < exposures; ++k) {
    field.Move(troubles);
    const sim::Image image = sim::TakeImage(field.Sources(), traits, &field.rng());
    const Exposure exposure = test::ExposureOf(image, std::to_string(k));
    const std::vector<UnitExpectation> expectations = field.Expectations();
    if (k % 10 == 0) calibration_ms.push_back(CalibrationMs());
    const double begin_ms = CpuMs();
    const auto checked = CheckSpots(
        exposure, {.columns_px = traits.sensor_px.real(), .rows_px = traits.sensor_px.imag()});
    const auto result = Identify({.layout = &field.layout(),
                                  .expectations = expectations,
                                  .fiducials = field.fiducials(),
                                  .camera = &model,
                                  .exposure = &exposure},
                                 {});
    cpu_ms.push_back(CpuMs() - begin_ms);
    if (!checked || !result) {
      ++refused;
      std::printf("exposure %d refused: %s\n", k,
                  checked ? result.error().text.c_str() : checked.error().text.c_str());
      continue;
    }
    const Judgement one = test::Judge(field, image, *result);
    if (one.wrong + one.pairs_unseen > 0)
      std::printf("exposure %d: %u wrong, %u swaps unseen\n", k, one.wrong, one.pairs_unseen);
    Add(one, &all);
    air_mm += result->air.sigma_mm;
    length_mm += result->air.length_mm;
    residual_mm += result->map_sigma_mm;
  }
  std::printf("%d exposures of %d units, %zu fiducials, air %.1f um; refused %d\n", exposures,
              units, field.fiducials().size(), traits.air.sigma_mm * 1e3, refused);
  for (std::size_t k = 0; k < all.count.size(); ++k)
    std::printf("  %-15s %10u\n", Name(static_cast<MeasurementStatus>(k)), all.count[k]);
  std::printf(
      "wrong and not flagged %u; wrong story %u; wrong and flagged %u; healthy, visible "
      "and not certain %u\n",
      all.wrong, all.wrong_story, all.flagged_wrong, all.lost);
  std::printf(
      "swaps: %u pairs, found %u, one or both not visible %u, same place %u, undecided and "
      "said %u (with those not visible %u suspected by name), unseen %u\n",
      all.pairs, all.pairs_found, all.pairs_dark, all.pairs_alike, all.pairs_flagged,
      all.pairs_suspected, all.pairs_unseen);
  const double placed = std::max(1.0, static_cast<double>(all.placed));
  const double taken = std::max(1, exposures - refused);
  std::printf(
      "places: %.2f um rms of a coordinate, %.3f of the variance claimed; air found %.2f "
      "um over %.0f mm, of which %.2f um are left by the map's own account\n",
      std::sqrt(all.squared_mm2 / placed / 2) * 1e3, all.squared_sigmas / placed,
      air_mm / taken * 1e3, length_mm / taken, residual_mm / taken * 1e3);
  std::printf("CPU ms an exposure: median %.1f, 95 %% %.1f, worst %.1f; calibration loop %.1f\n",
              Median(cpu_ms), Quantile(cpu_ms, 0.95), Quantile(cpu_ms, 1), Median(calibration_ms));
  return all.wrong + all.pairs_unseen == 0 ? 0 : 1;
}

}  // namespace
}  // namespace focalfleet

int main(int argc, char** argv) { return focalfleet::Run(argc, argv); }
