// state.csv: where every axis stands, whole turns included; the poses of disabled units stand here
// too.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "fleet/drive.h"
#include "fleet/layout.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// The pose of each unit that the file names, as the nearest whole vectors. Shape: (n).
/// Errors: kInvalid with file:line: a column or value missing, a unit unknown or twice, an enabled
/// unit out of its axes' ranges (a disabled one stands where it stands).
Result<std::vector<std::optional<Pose>>> ReadState(std::string_view text, std::string file,
                                                   const Layout& layout,
                                                   std::span<const UnitDrive> drives);

enum class WhoseState : std::uint8_t { kAll, kDisabled };
/// A plan needs to know where each unit stands, a draw of targets where the disabled ones do.
/// Errors: kInvalid names the file and the units without a pose.
Status RequirePoses(const std::string& file, const Layout& layout,
                    std::span<const std::optional<Pose>> poses, WhoseState whose);

/// A row for each unit that has a pose. Reads back equal.
std::string WriteState(const Layout& layout, std::span<const UnitDrive> drives,
                       std::span<const std::optional<Pose>> poses);

}  // namespace focalfleet
