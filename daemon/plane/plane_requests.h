// The requests of the control socket of a plane's coordinator: status, state, wait, access, those
// about alarms, and commands (plane_commands.h). They are those of a daemon of its own, for the
// whole plane; all other verbs are a sector's affair and are asked of its own daemon.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "daemon/control/line_exchange.h"
#include "daemon/control/messages.h"
#include "daemon/plane/plane_alarms.h"
#include "daemon/plane/plane_link.h"
#include "daemon/plane/plane_preview.h"
#include "daemon/plane/plane_table.h"
#include "fleet/plane/plane_coordinator.h"

namespace focalfleet {

/// The coordinator at an instant.
struct PlaneInstant {
  const PlaneLayout* plane = nullptr;
  const PlaneCoordinator* coordinator = nullptr;
  HostInstant now;
  WallTime at;
  PlaneLinkCounters link;
  PlaneAlarms* alarms = nullptr;
  bool has_camera = false;
  std::string page = {};              // address of the operators' page; empty: there is none
  PlanOptions options = {};           // for previews
  const PlaneTable* table = nullptr;  // null: it is not looked at now
  SteadyTime steady = {};             // `now` of the table
};

/// The configuration under way, or the last one; docs/plane.md has the members.
Json PlaneConfigurationJson(const PlaneInstant& plane);
Json PlaneStatusJson(const PlaneInstant& plane);

class PlaneRequests {
 public:
  struct Options {
    DurationNs progress_period = Milliseconds(200);
    std::uint32_t own_pid = 0;  // clients of this process may ask on behalf of others
    std::function<void(const std::string&)> log;  // one sentence for each command
    /// Calls its argument with the table, which does not change meanwhile.
    std::function<void(const std::function<void(const PlaneTable&)>&)> read;
  };
  PlaneRequests(std::unique_ptr<LineExchange> server, Options options)
      : server_(std::move(server)), options_(std::move(options)) {}

  [[nodiscard]] int fd() const { return server_->fd(); }
  /// A turn: requests are read, questions answered, commands appended. Stops come first.
  void Service(const PlaneInstant& plane, std::vector<PlaneCommand>* commands);
  void Reply(const PlaneInstant& plane, const ReplyEffect& reply);
  /// Clients that wait receive progress, or the end that they wait for.
  void ShowProgress(const PlaneInstant& plane);
  [[nodiscard]] HostInstant wake_at() const {
    return pending_.empty() && !dry_run_ ? kNever : progress_at_;
  }
  /// The preview that is due to be planned; none: there is none.
  [[nodiscard]] std::optional<PlanePreview> TakePreview() {
    return std::exchange(preview_, std::nullopt);
  }
  /// The preview was planned, or could not be.
  void PreviewDone(const PlaneInstant& plane, const PlanDone& done);
  void Close();

 private:
  struct Pending {
    ClientId client = 0;
    std::uint64_t id = 0;
    bool wait = false;
    enum class Kind : std::uint8_t { kConfiguration, kRetarget, kStop } kind = Kind::kStop;
  };
  void Handle(const PlaneInstant& plane, const IncomingLine& line,
              std::vector<PlaneCommand>* commands);
  void Answer(const Pending& pending, const Result<Json>& result);
  void Plan(const PlaneInstant& plane, const ControlRequest& request, const Pending& pending);
  void ShowPlanning(const PlaneInstant& plane);

  std::unique_ptr<LineExchange> server_;
  Options options_;
  std::unordered_map<std::uint64_t, Pending> pending_;  // by the number of the command
  /// The preview under way.
  struct DryRun {
    Pending pending;
    std::uint32_t targeted = 0;
    std::vector<Preview::Refused> refused;
    HostInstant since;
  };
  std::optional<DryRun> dry_run_;
  std::optional<PlanePreview> preview_;
  std::uint64_t next_ = 1;
  HostInstant progress_at_{0};
};

}  // namespace focalfleet
