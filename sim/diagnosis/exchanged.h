// Units under each other's name. Either their fibres are: the measured places of two units belong
// to each other. Or their addresses on the bus are: each obeys what was meant for the other, since
// the campaign began or since somebody worked at the units.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "sim/diagnosis/diagnosis.h"
#include "sim/diagnosis/fit.h"

namespace focalfleet::sim {

/// Exchanges the measured places of two units where both were measured in one exposure; rows of
/// only one become missing.
void UndoSwap(const Exposures& exposures, std::size_t a, std::size_t b, Campaign* campaign);

/// Two units that make each other's moves, each from where it stands.
struct CommandSwap {
  std::size_t a = 0, b = 0;
  std::uint32_t since = 0;  // exposure
  double miss_mm = 0;       // rms, of both, since then
};

/// By the table's geometry.
std::vector<CommandSwap> FindCommandSwaps(const CampaignFacts& facts);

/// Gives each unit the moves that it made; what it did in an exposure that the other has no row of
/// becomes missing.
void UndoCommandSwap(const CampaignFacts& facts, const CommandSwap& swap, Campaign* campaign);

/// Sets all names right that are exchanged, for all of the campaign if they are fibres', and says
/// what was wrong. `fit`: of the campaign as it came. `as_named`: that campaign, where anything
/// was.
std::vector<CauseFound> UndoExchanges(const Fit& fit, Campaign* campaign, CampaignFacts* facts,
                                      std::optional<Campaign>* as_named);

}  // namespace focalfleet::sim
