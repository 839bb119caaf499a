#include "fleet/coordinate/clock_map.h"

#include <algorithm>
#include <cmath>

#include "protocol/base/check.h"

namespace focalfleet {
namespace {

constexpr double kTickNs = static_cast<double>(kTick.ns);

}  // namespace

bool ClockMap::Observe(const Reading& reading) {
  if (reading.earliest > reading.latest) return false;
  if (count_ > 0 && !RanThrough(reading)) count_ = 0;
  Keep(count_ > 0 ? Unwrap(reading.ticks, reading.latest) : reading.ticks, reading);
  const Rates rates = RatesByReadings();
  if (rates.low <= rates.high) return true;
  count_ = 0;
  Keep(reading.ticks, reading);
  return true;
}

// A counter that began anew since the newest reading shows at most the time since then. A counter
// that came round (every five days) looks the same, and costs what a restart does.
bool ClockMap::RanThrough(const Reading& reading) const {
  const auto since_ns = static_cast<double>((reading.latest - newest().earliest).ns);
  return static_cast<double>(reading.ticks) * kTickNs > kUsual.high * since_ns;
}

void ClockMap::Keep(std::int64_t ticks, const Reading& reading) {
  if (count_ == kReadings) {
    std::move(kept_.begin() + 1, kept_.end(), kept_.begin());
    --count_;
  }
  kept_[count_++] = {ticks, reading.earliest, reading.latest};
}

// Among all numbers with these low bits, the one nearest to where the last reading leads.
std::int64_t ClockMap::Unwrap(std::uint32_t ticks, HostInstant at) const {
  const std::int64_t expected = newest().ticks + (at - newest().middle()).ns / kTick.ns;
  return expected + static_cast<std::int32_t>(ticks - static_cast<std::uint32_t>(expected));
}

// A counter that shows T is at least T and less than T + 1 ticks old.
ClockMap::Rates ClockMap::RatesByReadings() const {
  Rates rates = kAny;
  for (std::size_t b = 1; b < count_; ++b) {
    for (std::size_t a = 0; a < b; ++a) {
      const auto ticks = static_cast<double>(kept_[b].ticks - kept_[a].ticks);
      const auto longest_ns = static_cast<double>((kept_[b].latest - kept_[a].earliest).ns);
      const auto shortest_ns = static_cast<double>((kept_[b].earliest - kept_[a].latest).ns);
      if (longest_ns > 0)
        rates.low = std::max(rates.low, (ticks - 1) * kTickNs / longest_ns - kWander);
      if (shortest_ns > 0)
        rates.high = std::min(rates.high, (ticks + 1) * kTickNs / shortest_ns + kWander);
    }
  }
  return rates;
}

ClockMap::Rates ClockMap::PossibleRates() const {
  const Rates rates = RatesByReadings();
  const Rates usual{std::max(rates.low, kUsual.low), std::min(rates.high, kUsual.high)};
  return usual.low <= usual.high ? usual : rates;
}

ClockMap::Line ClockMap::Fit(const Rates& rates) const {
  Line line;
  const HostInstant zero = newest().middle();
  const auto host_ns = [&](const Kept& kept) {
    return static_cast<double>((kept.middle() - zero).ns);
  };
  // A wide reading says little.
  const auto weight = [](const Kept& kept) {
    const double width_ns = static_cast<double>((kept.latest - kept.earliest).ns) + kTickNs;
    return 1 / (width_ns * width_ns);
  };
  double weights = 0;
  for (std::size_t k = 0; k < count_; ++k) {
    const double w = weight(kept_[k]);
    weights += w;
    line.ticks += w * static_cast<double>(kept_[k].ticks - newest().ticks);
    line.host_ns += w * host_ns(kept_[k]);
  }
  line.ticks /= weights;
  line.host_ns /= weights;
  double both = 0;
  double host = 0;
  for (std::size_t k = 0; k < count_; ++k) {
    const double t = static_cast<double>(kept_[k].ticks - newest().ticks) - line.ticks;
    const double h = host_ns(kept_[k]) - line.host_ns;
    both += weight(kept_[k]) * t * h;
    host += weight(kept_[k]) * h * h;
  }
  const double fitted = host > 0 ? both / host * kTickNs : (rates.low + rates.high) / 2;
  line.ns_per_tick = kTickNs / std::clamp(fitted, rates.low, rates.high);
  return line;
}

ClockMap::Rate ClockMap::rate() const {
  if (count_ == 0) return {0, kRateErrorMax};
  const Rates rates = PossibleRates();
  const Rates by_readings = RatesByReadings();
  const double fitted = kTickNs / Fit(rates).ns_per_tick;
  return {.error = fitted - 1,
          .bound = std::max(rates.high - fitted, fitted - rates.low),
          .least = by_readings.low - 1,
          .most = by_readings.high - 1};
}

void ClockMap::Narrow(const Kept& reading, std::int64_t ticks, const Rates& rates,
                      HostInstant* earliest, HostInstant* latest) {
  const auto apart = static_cast<double>(ticks - reading.ticks);
  const double least_ns = (apart - 1) * kTickNs;
  const double most_ns = (apart + 1) * kTickNs;
  const auto sooner =
      static_cast<std::int64_t>(std::floor(least_ns / (least_ns > 0 ? rates.high : rates.low)));
  const auto later =
      static_cast<std::int64_t>(std::ceil(most_ns / (most_ns > 0 ? rates.low : rates.high)));
  *earliest = std::max(*earliest, reading.earliest + DurationNs{sooner});
  *latest = std::min(*latest, reading.latest + DurationNs{later});
}

ClockMap::Instant ClockMap::TimeOf(std::uint32_t ticks) const {
  FOCALFLEET_CHECK(count_ > 0);
  const std::int64_t at = newest().ticks + static_cast<std::int32_t>(
                                               ticks - static_cast<std::uint32_t>(newest().ticks));
  const Rates rates = PossibleRates();
  HostInstant earliest{INT64_MIN};
  HostInstant latest{INT64_MAX};
  for (std::size_t k = 0; k < count_; ++k) Narrow(kept_[k], at, rates, &earliest, &latest);
  if (earliest > latest) {  // a rate that changed by more than kWander
    earliest = {INT64_MIN};
    latest = {INT64_MAX};
    Narrow(newest(), at, {std::min(rates.low, kUsual.low), std::max(rates.high, kUsual.high)},
           &earliest, &latest);
  }
  const Line line = Fit(rates);
  const double host_ns =
      line.host_ns + (static_cast<double>(at - newest().ticks) - line.ticks) * line.ns_per_tick;
  const HostInstant likely = newest().middle() + DurationNs{static_cast<std::int64_t>(host_ns)};
  return {std::clamp(likely, earliest, latest), earliest, latest};
}

}  // namespace focalfleet
