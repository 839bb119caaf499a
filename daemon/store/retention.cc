#include "daemon/store/retention.h"

#include <algorithm>
#include <utility>

namespace focalfleet {

WallTime OldBefore(const HistoryAge& age) {
  constexpr std::int64_t kDayNs = 86'400'000'000'000;
  if (age.keep_days == 0 || age.newest.ns == 0) return WallTime{0};
  const std::int64_t now_ns =
      std::min(age.now.ns, age.newest.ns + static_cast<std::int64_t>(1e9 * age.open_s));
  return WallTime{now_ns - age.keep_days * kDayNs};
}

Result<std::function<bool()>> PruningOf(Store* store, Retention retention,
                                        std::function<void(const std::string&)> failed) {
  FOCALFLEET_TRY_ASSIGN(const WallTime newest, store->Newest());
  const std::int64_t opened_ns = retention.monotonic_ns();
  return [store, retention = std::move(retention), failed = std::move(failed), newest, opened_ns] {
    constexpr std::uint32_t kRowsAtOnce = 2000;  // looked at; some 10 ms
    const double open_s = 1e-9 * static_cast<double>(retention.monotonic_ns() - opened_ns);
    const WallTime before = OldBefore({.now = retention.wall(),
                                       .newest = newest,
                                       .open_s = open_s,
                                       .keep_days = retention.keep_days});
    if (before.ns <= 0) return false;
    const auto gone = store->Prune(before, kRowsAtOnce);
    if (!gone) failed("old history stays for now: " + gone.error().text);
    return gone && gone->more;
  };
}

}  // namespace focalfleet
