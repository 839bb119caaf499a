// Rows of one frame_id were measured with the camera at one place. Between frames the camera, or
// the bench before it, was moved: a frame may be shifted, turned and scaled against another one.
// The places of all frames are brought into one here, as well as expected places show it. A fit
// takes what is left of the motion as unknown (diagnosis/model/model.h).
#pragma once

#include <complex>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "sim/campaigns/campaign/campaign.h"

namespace focalfleet::sim {

/// The frames of a campaign. Rows without a frame_id are a frame of their own. The frame with most
/// rows is the first one.
struct Frames {
  std::vector<double> id;             // NaN: rows without one
  std::vector<std::uint32_t> of_row;  // Shape: (rows); empty where there is one frame
  [[nodiscard]] std::size_t size() const { return id.size(); }
};
Frames FindFrames(const Campaign& campaign);

/// A place for each row, in mm.
struct Places {
  std::vector<double> x_mm;  // Shape: (rows)
  std::vector<double> y_mm;
};

/// Shift, turn and scale of an image. Places are complex numbers, x + iy, in mm.
struct Similarity {
  std::complex<double> shift_mm = 0;
  std::complex<double> factor = 1;  // its angle is the turn, counter-clockwise
  [[nodiscard]] std::complex<double> Of(std::complex<double> place) const {
    return shift_mm + factor * place;
  }
  [[nodiscard]] std::complex<double> Undone(std::complex<double> place) const {
    return (place - shift_mm) / factor;
  }
};

/// Shift, turn and scale that take expected places to those measured in a frame, with the least
/// sum of distances: few rows that are far off do not count. Shape: (frames). Errors of the
/// expected places are in all frames alike: two frames compare better than either is known.
std::vector<Similarity> FitFrames(const Frames& frames, const Places& expected,
                                  const Places& measured);

/// Takes the places of all frames to one, which has that similarity to the expected places. With
/// none it is that of the expected places themselves. `found`: by FitFrames.
void TakeToOne(const Frames& frames, const std::vector<Similarity>& found, const Similarity& one,
               Places* measured);

}  // namespace focalfleet::sim
