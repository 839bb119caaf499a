// A network between the daemons of a plane, on virtual time: it delays, drops and doubles messages,
// and passes nothing over a link that is cut. A link has a direction. Chance comes from the seed.
#pragma once

#include <cstdint>
#include <map>
#include <utility>
#include <variant>
#include <vector>

#include "fleet/plane/plane_messages.h"
#include "protocol/base/rng.h"

namespace focalfleet::test {

using PlaneMessage = std::variant<PlaneOrder, SectorReport, BorderNews>;

class PlaneNetwork {
 public:
  struct Weather {
    double lost = 0;     // share of messages
    double doubled = 0;  // share of messages
    DurationNs delay_least = Microseconds(100);
    DurationNs delay_most = Milliseconds(5);
  };
  explicit PlaneNetwork(Rng rng) : rng_(rng) {}

  struct Delivery {
    std::uint32_t to = 0;
    PlaneMessage message;
  };
  void Send(std::uint32_t from, std::uint32_t to, const PlaneMessage& message, HostInstant now) {
    ++sent;
    if (const auto cut = cut_.find({from, to}); cut != cut_.end() && now < cut->second) return;
    if (rng_.Uniform() < weather.lost) return;
    const int copies = rng_.Uniform() < weather.doubled ? 2 : 1;
    for (int n = 0; n < copies; ++n) {
      const double spread = rng_.Uniform(0, 1);
      DurationNs delay{
          weather.delay_least.ns +
          static_cast<std::int64_t>(
              spread * static_cast<double>((weather.delay_most - weather.delay_least).ns))};
      for (const std::uint32_t node : {from, to})
        if (const auto at = slow.find(node); at != slow.end()) delay = delay + at->second;
      under_way_.emplace(now + delay, Delivery{to, message});
    }
  }
  std::vector<Delivery> TakeDue(HostInstant now) {
    std::vector<Delivery> due;
    while (!under_way_.empty() && under_way_.begin()->first <= now) {
      due.push_back(std::move(under_way_.begin()->second));
      under_way_.erase(under_way_.begin());
    }
    return due;
  }
  [[nodiscard]] HostInstant due() const {
    return under_way_.empty() ? kNever : under_way_.begin()->first;
  }
  void Cut(std::uint32_t from, std::uint32_t to, HostInstant until) { cut_[{from, to}] = until; }
  void Heal() {
    cut_.clear();
    slow.clear();
    weather = {};
  }

  Weather weather;
  std::map<std::uint32_t, DurationNs> slow;  // messages from and to a node take so much longer
  std::uint64_t sent = 0;

 private:
  Rng rng_;
  std::multimap<HostInstant, Delivery> under_way_;
  std::map<std::pair<std::uint32_t, std::uint32_t>, HostInstant> cut_;
};

}  // namespace focalfleet::test
