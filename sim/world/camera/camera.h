// The fibre-view camera: back-lit fibres and fiducials go in, and a list of spots comes out. The
// spots have no names and stand in the order of the sensor's rows, as a detector of spots finds
// them. The camera changes the truth in this order:
//
// - The air and the optics displace each light, and a fibre may be dark.
// - Noise moves each centroid by sigma / sqrt(flux); flux 1 is a usual fibre.
// - Spots nearer than the blend length become one. Its centroid is weighted by flux, and its width
//   is the second moment: for two, 2.355^2 f1 f2 / (f1 + f2)^2 d^2 / 2 is added to its square.
// - Dust and cosmic rays add spots, and the sensor's edge cuts spots off.
//
// The lights in each spot are listed beside the spots, for tests and reports.
#pragma once

#include <complex>
#include <cstdint>
#include <vector>

#include "protocol/base/ids.h"
#include "protocol/base/rng.h"
#include "sim/world/camera/optics.h"
#include "sim/world/camera/turbulence.h"
#include "sim/world/world.h"

namespace focalfleet::sim {

enum class LightKind : std::uint8_t { kFibre, kFiducial };

struct LightSource {
  LightKind kind = LightKind::kFibre;
  std::uint32_t id = 0;  // unit or fiducial
  std::complex<double> place_mm;
  double flux = 1;
};

struct CameraTraits {
  Optics optics;
  TurbulenceLaw air;
  std::complex<double> sensor_px{11000, 11000};  // columns, rows
  double centroid_sigma_px = 0.01;               // of one coordinate at flux 1: 2 um at 5 px/mm
  double flux_scatter = 0;                       // relative, from exposure to exposure
  double fwhm_px = 2.2;
  double fwhm_scatter = 0;   // relative, of one measured width
  double blend_fwhm = 1;     // spots nearer than this many widths become one
  double missing_share = 0;  // of fibres; fiducials too
  double extra_share = 0;    // of the count of sources, rounded; anywhere within their rim
  // Each exposure has its own change; the values are standard deviations.
  double scale_change_ppm = 0;
  double rotation_change_deg = 0;
  double shift_change_px = 0;
};

struct ImageSpot {
  double x_px = 0;
  double y_px = 0;
  double flux = 0;
  double fwhm_px = 0;
};

struct Image {
  std::vector<ImageSpot> spots;
  /// The lights in each spot: indices into the sources; none: an extra spot. Shape: as spots.
  std::vector<std::vector<std::uint32_t>> light;
};

/// A single exposure. Cost: O(n log n), about 15 ms for 5000 fibres with air.
Image TakeImage(const std::vector<LightSource>& sources, const CameraTraits& traits, Rng* rng);

/// Every fibre of the world at world.now(), row by row, at flux 1.
std::vector<LightSource> FibresOf(const World& world);

}  // namespace focalfleet::sim
