#include "daemon/process/store_upkeep.h"

#include <spdlog/spdlog.h>

#include <string>
#include <utility>

#include "daemon/loop/event_log.h"
#include "daemon/store/retention.h"

namespace focalfleet {

Result<std::function<bool()>> UpkeepOf(Store* store, std::uint32_t keep_days,
                                       std::function<bool(const AuditHead&)> report) {
  const auto warn = [](const std::string& text) { spdlog::warn("{}", text); };
  FOCALFLEET_TRY_ASSIGN(auto prune, PruningOf(store, {.keep_days = keep_days}, warn));
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
