// The motion of the image may follow a column of the table. The image itself is then not the cause:
// a motion that follows the wind is caused by the wind.
#pragma once

#include <Eigen/Dense>
#include <cstddef>
#include <optional>
#include <string_view>
#include <vector>

#include "sim/campaigns/diagnosis/decide/diagnosis.h"
#include "sim/campaigns/effects/track.h"

namespace focalfleet::sim {

/// The channel of a column that the image's shifts follow.
inline constexpr std::string_view kImageShift = "the image's shift";

/// Shift (2), turn and scale of an image, um at the plate's edge.
using ImageMotion = Eigen::Matrix<double, 4, 1>;

/// The column that the image's shifts follow best, where it is no chance and more than time
/// explains; or one slow wave of time. `shifts`: of the exposures `seen`. `signal`: share of their
/// variance that is no noise. `size_um`: rms of the motion.
std::optional<UnknownFound> FollowedColumn(const CampaignFacts& facts,
                                           const std::vector<std::size_t>& seen,
                                           const std::vector<ImageMotion>& shifts, double signal,
                                           double size_um);

}  // namespace focalfleet::sim
