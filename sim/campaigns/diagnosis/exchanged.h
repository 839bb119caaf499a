// Units under each other's name. Either their fibres are, for all of the campaign or for a while:
// the measured places of two units belong to each other. Or their addresses on the bus are: each
// obeys what was meant for the other, since the campaign began or since somebody worked at the
// units.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "sim/campaigns/diagnosis/diagnosis.h"

namespace focalfleet::sim {

/// Two fibres that are known under each other's name, in stretches of their rows.
struct FibreSwap {
  struct Stretch {
    std::size_t begin_a = 0, end_a = 0, begin_b = 0, end_b = 0;
    bool operator==(const Stretch&) const = default;
  };
  std::size_t a = 0, b = 0;
  std::vector<Stretch> stretches;
  double miss_mm = 0;  // rms, of both, in these rows

  /// For all of the campaign.
  static FibreSwap Whole(const Campaign& campaign, std::size_t a, std::size_t b);
};

/// By the table's geometry: each stands where the other's fibre should, in three exposures at
/// least of each stretch.
std::vector<FibreSwap> FindFibreSwaps(const CampaignFacts& facts);

/// Exchanges the measured places of the two where both were measured; rows of only one become
/// missing.
void UndoFibreSwap(const Exposures& exposures, const FibreSwap& swap, Campaign* campaign);

/// Two and two that stand where the other should, in fewer exposures: somebody gave the spots of an
/// image to the wrong units. Ascending.
std::vector<std::size_t> RowsUnderAnothersName(const CampaignFacts& facts);

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
/// came, where anything was. Pre: `facts` are of `campaign`.
std::vector<CauseFound> UndoExchanges(Campaign* campaign, CampaignFacts* facts,
                                      std::optional<Campaign>* as_named);

}  // namespace focalfleet::sim
