// Two units may be exchanged in two ways. Their fibres may be, for all of the campaign or for a
// while: the measured places of two units belong to each other. Their bus addresses may be: each
// unit obeys the commands for the other, since the campaign began or since work on the units.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "sim/campaigns/diagnosis/decide/diagnosis.h"

namespace focalfleet::sim {

/// Two fibres under each other's name, in stretches of their rows.
struct FibreSwap {
  struct Stretch {
    std::size_t begin_a = 0, end_a = 0, begin_b = 0, end_b = 0;
    bool operator==(const Stretch&) const = default;
  };
  std::size_t a = 0, b = 0;
  std::vector<Stretch> stretches;
  double miss_mm = 0;               // rms, of both, in these rows
  double delta_log_likelihood = 0;  // of the exchange, in these rows

  /// An exchange for all of the campaign.
  static FibreSwap Whole(const Campaign& campaign, std::size_t a, std::size_t b);
};

/// Pairs in which each fibre is where the other's should be by the table's geometry, in three
/// exposures at least of each stretch.
std::vector<FibreSwap> FindFibreSwaps(const CampaignFacts& facts);

/// Exchanges the measured places of the two where both were measured; rows of only one become
/// missing.
void UndoFibreSwap(const Exposures& exposures, const FibreSwap& swap, Campaign* campaign);

/// Rows of pairs that are at each other's place, in fewer exposures: an image's spots were assigned
/// to the wrong units. Ascending.
std::vector<std::size_t> RowsUnderAnothersName(const CampaignFacts& facts);

/// Two units that make each other's moves, each from its own pose.
struct CommandSwap {
  std::size_t a = 0, b = 0;
  std::uint32_t since = 0;          // exposure
  double miss_mm = 0;               // rms, of both, since then
  double delta_log_likelihood = 0;  // of the exchange
};

/// Pairs that make each other's moves by the table's geometry.
std::vector<CommandSwap> FindCommandSwaps(const CampaignFacts& facts);

/// Gives each unit the moves that it made. Rows of an exposure that the other unit lacks become
/// missing.
void UndoCommandSwap(const CampaignFacts& facts, const CommandSwap& swap, Campaign* campaign);

/// Corrects all names that are exchanged, and returns the causes. `as_named`: the unchanged
/// campaign, where any name was wrong. Pre: `facts` are of `campaign`.
std::vector<CauseFound> UndoExchanges(Campaign* campaign, CampaignFacts* facts,
                                      std::optional<Campaign>* as_named);

}  // namespace focalfleet::sim
