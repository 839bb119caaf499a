// The parts of a reproduction, one file each; they share how a claim is judged.
#pragma once

#include <string>
#include <vector>

#include "sim/drive/drive.h"
#include "sim/drive/reproduction/reproduce.h"

namespace focalfleet::sim::reproduction {

/// Motor, bridge as printed, nominal gearhead.
Drive::Setting PaperSetting(const ReproduceOptions& options, std::string_view set, double v_bus_V);
/// The bridge without dead time and ramps.
Drive::Setting Ideal(Drive::Setting setting);

/// Reproduced where every simulated number is within `tolerance` of the paper's; else disagrees.
ClaimStatus Within(const Claim& claim, double tolerance);
enum class Order { kRises, kFalls };
/// Ordering where the simulated numbers rise (fall) strictly; else disagrees.
ClaimStatus InOrder(const std::vector<double>& numbers, Order order);

void AddTimes(const ReproduceOptions& options, Reproduction* out);
void AddWaves(const ReproduceOptions& options, Reproduction* out);
void AddStarts(const ReproduceOptions& options, const ReproduceProgress& progress,
               Reproduction* out);
void AddPositions(const ReproduceOptions& options, Reproduction* out);

}  // namespace focalfleet::sim::reproduction
