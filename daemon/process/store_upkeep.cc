#include "daemon/process/store_upkeep.h"

#include <spdlog/spdlog.h>

#include <chrono>
#include <utility>

#include "daemon/loop/event_log.h"

namespace focalfleet {

Result<std::function<bool()>> PruningOf(Store* store, std::uint32_t keep_days) {
  FOCALFLEET_TRY_ASSIGN(const WallTime newest, store->Newest());
  const auto opened = std::chrono::steady_clock::now();
  return [store, keep_days, newest, opened] {
    constexpr std::uint32_t kRowsAtOnce = 2000;  // looked at; some 10 ms
    const std::chrono::duration<double> open = std::chrono::steady_clock::now() - opened;
    const WallTime before = OldBefore(
        {.now = WallTime::Now(), .newest = newest, .open_s = open.count(), .keep_days = keep_days});
    if (before.ns <= 0) return false;
    const auto gone = store->Prune(before, kRowsAtOnce);
    if (!gone) spdlog::warn("old history stays for now: {}", gone.error().text);
    return gone && gone->more;
  };
}

Result<std::function<bool()>> UpkeepOf(Store* store, std::uint32_t keep_days,
                                       std::function<bool(const AuditHead&)> report) {
  FOCALFLEET_TRY_ASSIGN(auto prune, PruningOf(store, keep_days));
  return [store, prune = std::move(prune), report = std::move(report), logged = AuditHead(),
          reported = AuditHead(), more = false]() mutable {
    // Pieces of pruning follow one another; the head is for the first of each round.
    if (!more) {
      const auto head = store->LastAudit();
      if (!head) spdlog::warn("the head of the audit is not known: {}", head.error().text);
      if (head && *head != logged) LogAuditHead(logged = *head);
      if (head && *head != reported && report(*head)) reported = *head;
    }
    more = prune();
    return more;
  };
}

}  // namespace focalfleet
