// state.csv: the place of every axis, whole turns included; the poses of disabled units are here
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
/// Every unit that `whose` asks for has a pose. A plan needs the places of all units, a draw of
/// targets those of the disabled ones. Errors: kInvalid names the file and the units without a
/// pose.
Status RequirePoses(const std::string& file, const Layout& layout,
                    std::span<const std::optional<Pose>> poses, WhoseState whose);

/// A row for each unit that has a pose. The text reads back equal.
std::string WriteState(const Layout& layout, std::span<const UnitDrive> drives,
                       std::span<const std::optional<Pose>> poses);

}  // namespace focalfleet
