#include "fleet/camera/assignment.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace focalfleet {
namespace {

constexpr double kAssignmentsMax = 2e4;  // of one group; a larger group is not counted

// All claims of one unit on one spot.
struct Option {
  std::uint32_t spot = 0;
  double weight = 0;  // odds, over the largest of the unit's
  PlaceKind kind = PlaceKind::kExpected;
  double kind_doubt = 0;
  double marginal = 0;
};

struct Claimant {
  std::uint32_t unit = 0;
  double weight_of_none = 1;
  double marginal_of_none = 0;
  std::vector<Option> options;
};

class Roots {
 public:
  explicit Roots(std::size_t n) : root_(n) { std::iota(root_.begin(), root_.end(), 0u); }
  std::uint32_t Of(std::uint32_t k) {
    while (root_[k] != k) k = root_[k] = root_[root_[k]];
    return k;
  }
  void Join(std::uint32_t a, std::uint32_t b) { root_[Of(a)] = Of(b); }

 private:
  std::vector<std::uint32_t> root_;
};

// `claims`: one unit's, sorted by spot.
Claimant ClaimantOf(std::span<const Claim> claims) {
  Claimant claimant;
  claimant.unit = claims.front().unit;
  double largest = 0;
  for (const Claim& claim : claims) largest = std::max(largest, claim.log_odds);
  claimant.weight_of_none = std::exp(-largest);
  double best_of_kind = 0;
  for (const Claim& claim : claims) {
    const double weight = std::exp(claim.log_odds - largest);
    if (claimant.options.empty() || claimant.options.back().spot != claim.spot) {
      claimant.options.push_back({claim.spot, 0, claim.kind, 0, 0});
      best_of_kind = 0;
    }
    Option& option = claimant.options.back();
    option.weight += weight;
    if (weight > best_of_kind) {
      best_of_kind = weight;
      option.kind = claim.kind;
    }
    option.kind_doubt = 1 - best_of_kind / option.weight;
  }
  return claimant;
}

// Visits every assignment of a group and adds its weight to each answer that it includes.
class Enumeration {
 public:
  explicit Enumeration(std::span<Claimant> group) : group_(group), choice_(group.size()) {}

  void Run() {
    Descend(0, 1);
    for (Claimant& claimant : group_) {
      claimant.marginal_of_none /= total_;
      for (Option& option : claimant.options) option.marginal /= total_;
    }
  }

 private:
  void Descend(std::size_t depth, double weight) {
    if (depth == group_.size()) {
      total_ += weight;
      for (std::size_t k = 0; k < group_.size(); ++k)
        (choice_[k] == nullptr ? group_[k].marginal_of_none : choice_[k]->marginal) += weight;
      return;
    }
    choice_[depth] = nullptr;
    Descend(depth + 1, weight * group_[depth].weight_of_none);
    for (Option& option : group_[depth].options) {
      const bool taken =
          std::any_of(choice_.begin(), choice_.begin() + static_cast<std::ptrdiff_t>(depth),
                      [&option](const Option* other) {
                        return other != nullptr && other->spot == option.spot;
                      });
      if (taken) continue;
      choice_[depth] = &option;
      Descend(depth + 1, weight * option.weight);
    }
    choice_[depth] = nullptr;
  }

  std::span<Claimant> group_;
  std::vector<Option*> choice_;
  double total_ = 0;
};

Decision DecisionOf(const Claimant& claimant) {
  Decision decision{claimant.unit, kNoSpot, PlaceKind::kExpected, 0, 0, false};
  double best = claimant.marginal_of_none;
  for (const Option& option : claimant.options) {
    if (option.marginal <= best) continue;
    best = option.marginal;
    decision.spot = option.spot;
    decision.kind = option.kind;
    decision.kind_doubt = option.kind_doubt;
  }
  decision.doubt = 1 - best;
  return decision;
}

void DecideGroup(std::span<Claimant> group, std::vector<Decision>* decisions) {
  double assignments = 1;
  for (const Claimant& claimant : group)
    assignments *= static_cast<double>(claimant.options.size()) + 1;
  if (assignments > kAssignmentsMax) {
    for (const Claimant& claimant : group)
      decisions->push_back({claimant.unit, kNoSpot, PlaceKind::kExpected, 1, 1, true});
    return;
  }
  Enumeration(group).Run();
  for (const Claimant& claimant : group) decisions->push_back(DecisionOf(claimant));
}

}  // namespace

std::vector<Decision> Assign(std::vector<Claim> claims) {
  std::sort(claims.begin(), claims.end(), [](const Claim& a, const Claim& b) {
    if (a.unit != b.unit) return a.unit < b.unit;
    return a.spot != b.spot ? a.spot < b.spot : a.kind < b.kind;
  });
  std::vector<Claimant> claimants;
  std::uint32_t spot_end = 0;
  for (std::size_t begin = 0; begin < claims.size();) {
    std::size_t end = begin;
    while (end < claims.size() && claims[end].unit == claims[begin].unit) {
      spot_end = std::max(spot_end, claims[end].spot + 1);
      ++end;
    }
    claimants.push_back(ClaimantOf(std::span(claims).subspan(begin, end - begin)));
    begin = end;
  }
  Roots roots(spot_end + claimants.size());
  for (std::uint32_t k = 0; k < claimants.size(); ++k)
    for (const Option& option : claimants[k].options) roots.Join(spot_end + k, option.spot);
  std::vector<std::pair<std::uint32_t, std::uint32_t>> by_group;
  for (std::uint32_t k = 0; k < claimants.size(); ++k)
    by_group.emplace_back(roots.Of(spot_end + k), k);
  std::sort(by_group.begin(), by_group.end());
  std::vector<Decision> decisions;
  decisions.reserve(claimants.size());
  std::vector<Claimant> group;
  for (std::size_t begin = 0; begin < by_group.size();) {
    group.clear();
    std::size_t end = begin;
    for (; end < by_group.size() && by_group[end].first == by_group[begin].first; ++end)
      group.push_back(std::move(claimants[by_group[end].second]));
    DecideGroup(group, &decisions);
    begin = end;
  }
  std::sort(decisions.begin(), decisions.end(),
            [](const Decision& a, const Decision& b) { return a.unit < b.unit; });
  return decisions;
}

}  // namespace focalfleet
