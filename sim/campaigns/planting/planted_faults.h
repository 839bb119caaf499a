// Planted faults are causes that no effect of the library makes. They are lost moves, slips of the
// rotor, fibres under each other's name, sensors with another gain, and moving air.
#pragma once

#include <cstdint>
#include <string_view>

#include "sim/campaigns/effects/track.h"
#include "sim/campaigns/planting/planted.h"

namespace focalfleet::sim {

/// Whether the cause is planted here.
bool IsPlantedFault(std::string_view cause);

/// Changes the campaign's measured places, or its reported temperatures for sensor_bias. The
/// amplitude depends on the fault. lost_command: moves of each unit that has it, of both axes.
/// step_loss: motor turns of the axis (theta where none is given), once. identity_swap: pairs.
/// sensor_bias: gain less one, of whole rails where there are several. air_turbulence: rms of a
/// coordinate in um.
/// Pre: IsPlantedFault.
/// Errors: kInvalid: the campaign has no such part, or fewer of it.
Status PlantFault(const PlantedEffect& planted, const CampaignFacts& facts, std::uint64_t seed,
                  Campaign* campaign);

}  // namespace focalfleet::sim
