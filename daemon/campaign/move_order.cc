#include "daemon/campaign/move_order.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <tuple>
#include <unordered_map>

namespace focalfleet {
namespace {

// A stable sort: rows that compare as equal keep their order in the file.
template <class Key>
std::vector<std::size_t> Sorted(std::size_t rows, const Key& key) {
  std::vector<std::size_t> order(rows);
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, {}, key);
  return order;
}

bool IsUntimed(const MoveKey& key) { return std::isnan(key.t_s); }

void TimeByExposures(std::vector<MoveKey>* keys) {
  std::unordered_map<std::int64_t, double> first_s;
  for (const MoveKey& key : *keys) {
    if (IsUntimed(key)) continue;
    const auto [time_s, fresh] = first_s.emplace(key.move, key.t_s);
    if (!fresh) time_s->second = std::min(time_s->second, key.t_s);
  }
  for (MoveKey& key : *keys)
    if (IsUntimed(key))
      if (const auto time_s = first_s.find(key.move); time_s != first_s.end())
        key.t_s = time_s->second;
}

void TimeByMovesBefore(std::vector<MoveKey>* keys) {
  constexpr double kBeforeAll = -std::numeric_limits<double>::infinity();
  const std::vector<std::size_t> order = Sorted(keys->size(), [&](std::size_t row) {
    return std::pair((*keys)[row].unit, (*keys)[row].move);
  });
  for (std::size_t k = 0; k < order.size(); ++k) {
    MoveKey& key = (*keys)[order[k]];
    if (!IsUntimed(key)) continue;
    const bool is_first = k == 0 || (*keys)[order[k - 1]].unit != key.unit;
    key.t_s = is_first ? kBeforeAll : (*keys)[order[k - 1]].t_s;
  }
}

// Counts rows that stand behind a later move of their unit.
std::size_t CountOutOfOrder(const std::vector<MoveKey>& keys) {
  std::unordered_map<std::size_t, const MoveKey*> latest;
  std::size_t count = 0;
  for (const MoveKey& key : keys) {
    const MoveKey*& last = latest[key.unit];
    if (last != nullptr && std::tie(key.t_s, key.move) < std::tie(last->t_s, last->move))
      ++count;
    else
      last = &key;
  }
  return count;
}

}  // namespace

MoveOrder OrderMoves(std::vector<MoveKey> keys) {
  if (std::ranges::any_of(keys, IsUntimed)) TimeByExposures(&keys);
  if (std::ranges::any_of(keys, IsUntimed)) TimeByMovesBefore(&keys);
  MoveOrder order{.out_of_order = CountOutOfOrder(keys)};
  if (order.out_of_order == 0)
    order.rows = Sorted(keys.size(), [&](std::size_t row) { return keys[row].unit; });
  else
    order.rows = Sorted(keys.size(), [&](std::size_t row) {
      return std::tuple(keys[row].unit, keys[row].t_s, keys[row].move);
    });
  return order;
}

}  // namespace focalfleet
