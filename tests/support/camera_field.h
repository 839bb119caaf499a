// The camera field is a focal plane in front of a simulated camera, with planted troubles of real
// ones. The judge compares an identification with the true sources. The truth is drawn with the
// simulator's mechanisms and imaged with its camera. The code under judgement (fleet/camera) has no
// part in it.
#pragma once

#include <array>
#include <complex>
#include <cstdint>
#include <string>
#include <vector>

#include "fleet/camera/identify.h"
#include "fleet/hex_layout.h"
#include "fleet/layout.h"
#include "protocol/base/rng.h"
#include "sim/world/camera/camera.h"
#include "sim/world/mechanism.h"

namespace focalfleet::test {

struct FieldTroubles {
  double blind_sigma_deg = 0.22;      // of each axis: 54 um rms over the patrol area
  double tail_share = 0.004;          // of units; their errors are 3 to 30 times as large
  double dead_share = 0.02;           // of units; two of three with both axes, the others with one
  double slipping_share = 0.02;       // of units; they stop anywhere on their way
  double disabled_share = 0.01;       // of units; they shine and do not move
  int swaps = 20;                     // pairs; half of them are neighbours
  double corrected_sigma_mm = 0.005;  // of the place before the move: how well that is known
  bool collision_free = true;  // false: poses at random, fibres may be anywhere near each other
};

enum class PlantedFate : std::uint8_t { kHealthy, kDead, kSlipping, kDisabled, kSwapped };

struct PlantedUnit {
  PlantedFate fate = PlantedFate::kHealthy;
  std::array<bool, kAxisCount> stayed{};
  std::uint32_t swapped_with = UINT32_MAX;
  AxisAngles before;
  AxisAngles commanded;
  std::complex<double> before_mm;
  std::complex<double> place_mm;  // where the fibre truly is
};

/// The field is the fleet between two exposures.
class CameraField {
 public:
  CameraField(const HexLayoutOptions& options, std::uint64_t seed);

  /// Every unit goes to a new configuration; errors and troubles are drawn.
  void Move(const FieldTroubles& troubles);

  [[nodiscard]] const Layout& layout() const { return layout_; }
  [[nodiscard]] const std::vector<Fiducial>& fiducials() const { return fiducials_; }
  [[nodiscard]] const std::vector<PlantedUnit>& units() const { return units_; }
  [[nodiscard]] std::vector<PlantedUnit>& units() { return units_; }
  /// The fibres in the order of the layout, then the fiducials.
  [[nodiscard]] std::vector<sim::LightSource> Sources() const;
  /// The expectations of a coordinator: commands and earlier measurements, nothing of the truth.
  [[nodiscard]] std::vector<UnitExpectation> Expectations() const;
  /// The true place of a unit's fibre at these angles.
  [[nodiscard]] std::complex<double> PlaceOf(std::uint32_t unit, const AxisAngles& angles) const;
  Rng& rng() { return rng_; }

 private:
  void DrawSwaps(const FieldTroubles& troubles);
  void PlantFates(const FieldTroubles& troubles);
  std::vector<AxisAngles> DrawAngles(bool collision_free);

  Rng rng_;
  Layout layout_;
  std::vector<Fiducial> fiducials_;
  std::vector<sim::Mechanism> mechanisms_;
  std::vector<PlantedUnit> units_;
};

/// The camera of the tests has 5 px/mm and a distortion of one millimetre at the rim, and is turned
/// a little.
sim::CameraTraits TestCamera(double rim_mm);
/// The model that a coordinator has of the camera: no distortion, and no changes between exposures.
CameraModel ModelOf(const sim::CameraTraits& traits);
/// The exposure as the port would deliver it.
Exposure ExposureOf(const sim::Image& image, std::string id);

struct Judgement {
  std::array<std::uint32_t, kMeasurementStatusCount> count{};
  std::uint32_t wrong = 0;        // certain, but the spot is not lit by the unit's fibre
  std::uint32_t wrong_story = 0;  // certain, its spot, but moved / did not move / swapped is false
  std::uint32_t flagged_wrong =
      0;                   // has a spot that is not its own, and is reported as not certain
  std::uint32_t lost = 0;  // visible, alone in its spot, and still not certain
  std::uint32_t pairs = 0;
  std::uint32_t pairs_found = 0;      // both name each other
  std::uint32_t pairs_dark = 0;       // one or both give no light of their own: cannot be closed
  std::uint32_t pairs_alike = 0;      // the two commands lead to the same place: cannot be seen
  std::uint32_t pairs_flagged = 0;    // not decided, but neither is called measured
  std::uint32_t pairs_suspected = 0;  // of those not found: one names the other
  std::uint32_t pairs_unseen = 0;     // none of these: a swap passed for something else
  double squared_mm2 = 0;             // of certain units' place errors, those alone in their spot
  double squared_sigmas = 0;  // the same in units of the variance that was claimed, per axis
  std::uint32_t placed = 0;
};

/// Judges an identification. The sources of `image` are those of CameraField::Sources.
Judgement Judge(const CameraField& field, const sim::Image& image, const Identification& result);

}  // namespace focalfleet::test
