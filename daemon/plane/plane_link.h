// The messages of a plane over DDS: orders from its coordinator, reports of its sectors, news
// between sectors (fleet/plane/plane_messages.h). Each sector's topics have a partition of their
// own, `sector-N`: a sector reads the orders of its partition alone, a coordinator the reports of
// all.
//
// Nothing is kept for late joiners, and nothing waits: every message has its sender's whole state
// and is repeated, so that the newest one is enough. The host may join the domain later than it
// starts (late_join.h); until then it says and hears nothing. With DDS Security the link takes new
// credentials by itself: a participant with them joins beside the old one, which leaves 10 s later.
// Messages come twice meanwhile, which does no harm.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/dds/status_publisher.h"
#include "fleet/plane/plane_messages.h"
#include "protocol/base/result.h"

namespace focalfleet {

struct PlaneMail {
  std::vector<PlaneOrder> orders;
  std::vector<SectorReport> reports;
  std::vector<BorderNews> news;
  [[nodiscard]] bool empty() const { return orders.empty() && reports.empty() && news.empty(); }
};

struct PlaneLinkCounters {
  std::uint64_t sent = 0;
  std::uint64_t sent_bytes = 0;  // bodies
  std::uint64_t received = 0;
  std::uint64_t received_bytes = 0;
  std::uint64_t refused = 0;  // of another format, or no message
};

class PlaneLink {
 public:
  struct Options {
    DdsOptions dds;
    /// The sector that is owned; none: this is a coordinator.
    std::optional<std::uint32_t> sector;
    std::function<void()> arrived;  // on the link's thread
    /// Receives each new reason why the domain cannot be joined, and an empty text afterwards.
    std::function<void(const std::string&)> tell = [](const std::string&) {};
  };
  explicit PlaneLink(Options options);
  PlaneLink(const PlaneLink&) = delete;
  PlaneLink& operator=(const PlaneLink&) = delete;
  ~PlaneLink();

  /// The message is offered to DDS, which sends it at once or drops it. Pre: one thread sends.
  void Send(const PlaneOrder& order);
  void Send(const SectorReport& report);
  void Send(const BorderNews& news);
  /// All that has arrived since the last call. Where more than kMailMax wait, the oldest are gone.
  PlaneMail Take();

  [[nodiscard]] PlaneLinkCounters counters() const;

  static constexpr std::size_t kMailMax = 1024;  // of each kind

 private:
  class Impl;
  std::shared_ptr<Impl> impl_;
};

}  // namespace focalfleet
