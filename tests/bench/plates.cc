#include "tests/bench/plates.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <numbers>
#include <sstream>

#include "fleet/files/layout_file.h"

namespace focalfleet::bench {
namespace {

constexpr double kObstacleShare = 0.1;     // its radius, of the pitch
constexpr double kRimBeyondShare = 0.9;    // its middle beyond the outermost base, of the pitch
constexpr double kRimRadiusShare = 0.125;  // half its width, of the pitch
constexpr double kGoldenTurn = 0.38196601125010515;

std::vector<Unit> UnitsOfFile() {
  const char* path = std::getenv("FOCALFLEET_DESI_UNITS");
  if (path == nullptr) return {};
  std::ifstream file(path);
  std::stringstream text;
  text << file.rdbuf();
  auto read = ReadUnits(text.str(), path);
  return read ? std::move(read->units) : std::vector<Unit>{};
}

HexLayoutOptions ProportionsOf(PlateKind kind, std::uint32_t count) {
  switch (kind) {
    case PlateKind::kSdssLike:
      return SdssLike(count);
    case PlateKind::kPfsLike:
      return {.count = count, .pitch_mm = 8, .theta_arm_mm = 2.375, .phi_arm_mm = 2.375};
    case PlateKind::kMoonsLike:
      return {.count = count, .pitch_mm = 25, .theta_arm_mm = 8, .phi_arm_mm = 17};
    default:
      return {.count = count};
  }
}

double DistanceMmOf(const PointFp& a, const PointFp& b) {
  return std::hypot(a.x_mm - b.x_mm, a.y_mm - b.y_mm);
}

double RimMm(const std::vector<Unit>& units) {
  double rim_mm = 0;
  for (const Unit& unit : units) rim_mm = std::max(rim_mm, DistanceMmOf(unit.base_fp, {}));
  return rim_mm;
}

/// Obstacles take the units' places nearest to the seeds of a sunflower.
void TakePlaces(std::uint32_t count, double radius_mm, Plate* plate) {
  const double rim_mm = RimMm(plate->units);
  for (std::uint32_t k = 0; k < count; ++k) {
    const double turn = 2 * std::numbers::pi * kGoldenTurn * k;
    const double r_mm = rim_mm * std::sqrt((k + 0.5) / count);
    const PointFp seed{r_mm * std::cos(turn), r_mm * std::sin(turn)};
    const auto nearest = std::min_element(
        plate->units.begin(), plate->units.end(), [&](const Unit& a, const Unit& b) {
          return DistanceMmOf(a.base_fp, seed) < DistanceMmOf(b.base_fp, seed);
        });
    plate->obstacles.push_back({k + 1, nearest->base_fp, radius_mm});
    plate->units.erase(nearest);
  }
}

void AddRim(double pitch_mm, Plate* plate) {
  const double radius_mm = kRimRadiusShare * pitch_mm;
  const double rim_mm = RimMm(plate->units) + kRimBeyondShare * pitch_mm;
  const auto discs =
      static_cast<std::uint32_t>(std::ceil(2 * std::numbers::pi * rim_mm / radius_mm));
  const auto first = static_cast<std::uint32_t>(plate->obstacles.size()) + 1;
  for (std::uint32_t k = 0; k < discs; ++k) {
    const double turn = 2 * std::numbers::pi * k / discs;
    plate->obstacles.push_back(
        {first + k, {rim_mm * std::cos(turn), rim_mm * std::sin(turn)}, radius_mm});
  }
}

}  // namespace

Plate MakePlate(const PlateOptions& options) {
  Plate plate;
  if (options.kind == PlateKind::kFile) {
    plate.units = UnitsOfFile();
    return plate;
  }
  const HexLayoutOptions hex = ProportionsOf(options.kind, options.count + options.obstacles);
  plate.units = MakeHexLayout(hex);
  TakePlaces(options.obstacles, kObstacleShare * hex.pitch_mm, &plate);
  if (options.rim) AddRim(hex.pitch_mm, &plate);
  return plate;
}

const char* NameOf(PlateKind kind) {
  constexpr const char* kNames[kPlateKinds] = {"hexagonal", "DESI's plate", "SDSS-like", "PFS-like",
                                               "MOONS-like"};
  return kNames[static_cast<std::size_t>(kind)];
}

}  // namespace focalfleet::bench
