// The parts of a reproduction, one file each, and the functions with which they judge claims.
#pragma once

#include <string>
#include <vector>

#include "sim/drive/drive.h"
#include "sim/drive/reproduction/reproduce.h"

namespace focalfleet::sim::reproduction {

/// The motor, the bridge as printed, and the nominal gearhead.
Drive::Setting PaperSetting(const ReproduceOptions& options, std::string_view set, double v_bus_V);
/// The bridge without dead time and ramps.
Drive::Setting Ideal(Drive::Setting setting);

/// kReproduced where every simulated number is within `tolerance` of the paper's; else kDisagrees.
ClaimStatus Within(const Claim& claim, double tolerance);
enum class Order { kRises, kFalls };
/// kOrdering where the simulated numbers rise (or fall) strictly; else kDisagrees.
ClaimStatus InOrder(const std::vector<double>& numbers, Order order);

void AddTimes(const ReproduceOptions& options, Reproduction* out);
void AddWaves(const ReproduceOptions& options, Reproduction* out);
void AddStarts(const ReproduceOptions& options, const ReproduceProgress& progress,
               Reproduction* out);
void AddPositions(const ReproduceOptions& options, Reproduction* out);

}  // namespace focalfleet::sim::reproduction
