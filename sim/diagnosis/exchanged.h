// Units under each other's name. Either their fibres are, for all of the campaign or for a while:
// the measured places of two units belong to each other. Or their addresses on the bus are: each
// obeys what was meant for the other, since the campaign began or since somebody worked at the
// units.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "sim/diagnosis/diagnosis.h"

namespace focalfleet::sim {

/// Two fibres that are known under each other's name, from the first of these exposures to the
/// last.
struct FibreSwap {
  std::size_t a = 0, b = 0;
  std::uint32_t first = 0, last = UINT32_MAX;
  double miss_mm = 0;  // rms, of both, in these exposures
};

/// By the table's geometry: each stands where the other's fibre should, in three exposures at
/// least.
std::vector<FibreSwap> FindFibreSwaps(const CampaignFacts& facts);

/// Exchanges the measured places of the two where both were measured; rows of only one become
/// missing.
void UndoFibreSwap(const Exposures& exposures, const FibreSwap& swap, Campaign* campaign);

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

/// Sets all names right that are exchanged and says what was wrong. `as_named`: the campaign as it
/// came, where anything was.
std::vector<CauseFound> UndoExchanges(Campaign* campaign, CampaignFacts* facts,
                                      std::optional<Campaign>* as_named);

}  // namespace focalfleet::sim
