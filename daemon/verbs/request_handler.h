// The requests of the control socket. A request becomes a command of the coordinator, or is
// answered at once, by one instant of the core thread. Questions about the past are answered by the
// reader's thread (store_questions.h), those about the state of all units by rows of one instant
// (state_requests.h). Replies of the coordinator become answers, and clients that wait for a
// configuration receive its progress.
//
// A stop is handled before everything else that was read in a turn, even from behind other lines of
// its client. A turn with a stop handles no other line, so that the frames of the stop are on the
// buses before any answer is computed. Where the next turn brings a stop again, other lines are
// handled too.
// Each verb takes a role (access/rights.h). A request that its caller may not make is refused,
// named in the log and kept for the audit, as is each command.
//
// Requests of other verbs share a budget a turn (kTurnBytes); after it, the loop serves buses,
// signals and the next stop first. Motions that a stop overtook are refused, because the stop was
// meant for them, too.
//
// Where too many rows wait for a disk that is full, commands that write rows are refused before
// anything changes. A stop is always taken.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "daemon/access/log_limit.h"
#include "daemon/control/line_server.h"
#include "daemon/status/shell_facts.h"
#include "daemon/status/status_snapshot.h"
#include "daemon/store/store_reader.h"
#include "daemon/verbs/alarm_register.h"
#include "daemon/verbs/audit_trail.h"
#include "daemon/verbs/model_registry.h"
#include "daemon/verbs/state_requests.h"
#include "daemon/verbs/store_questions.h"
#include "fleet/coordinate/preview.h"
#include "fleet/coordinator.h"

namespace focalfleet {

class RequestHandler {
 public:
  struct Options {
    DurationNs progress_period = Milliseconds(200);
    DurationNs second = Seconds(1);  // a second of people, in the fleet's time
    std::function<ShellFacts()> facts;
    std::function<void(const std::string&)> log;  // one sentence for each command
    std::string store_path;
    StoreOptions store = {};
    ModelRegistry* models = nullptr;  // outlives the handler
    AlarmRegister* alarms = nullptr;  // likewise
    AuditTrail* audit = nullptr;      // likewise; none: nothing is kept
    /// A command may add rows to those that wait for the store. Errors: why it may not.
    std::function<Status()> room_for_rows = [] { return Status(); };
    std::uint32_t own_pid = 0;  // clients of this process may ask on behalf of others
  };
  RequestHandler(std::unique_ptr<LineExchange> server, Options options)
      : server_(std::move(server)), options_(std::move(options)), states_(server_.get()) {}

  /// Bytes of lines and answers of one turn; the line that exceeds them is the turn's last. A byte
  /// costs 10 to 30 ns, so the budget is about a millisecond. With half of it most answers to
  /// `status` would take two turns. With twice as much a stop would wait a millisecond longer.
  static constexpr std::size_t kTurnBytes = std::size_t{64} << 10;
  /// Cost of a line however short, as bytes: some 20 us of parsing, system calls and bookkeeping.
  static constexpr std::size_t kLineBytes = 1024;

  /// Whether the line is a stop, for LineServer::Options::urgent. A stop that no program would
  /// write so (over 512 bytes, or escapes in the word) is not urgent; it is handled in its turn.
  static bool IsStop(std::string_view line);

  [[nodiscard]] int fd() const { return server_->fd(); }

  /// A turn: requests are read, questions answered, commands appended.
  void Service(const FleetView& view, std::vector<Command>* commands);
  /// The client receives the coordinator's reply as its answer.
  void Reply(const FleetView& view, const ReplyEffect& reply);
  /// The planning job of a dry run that was asked for since the last call. The job never becomes
  /// the configuration; its answer goes to PreviewDone.
  std::optional<PlanJob> TakePreview();
  void PreviewDone(const FleetView& view, const PlanDone& done);
  /// Hands questions to the store over, the oldest first, until `submit` finds no room. A
  /// question for which `submit` returns false is untouched.
  void SubmitQuestions(const std::function<bool(StoreQuestion*)>& submit);
  /// The client receives the store's answer.
  void Answered(const StoreAnswer& answer);
  /// Those who wait for the state; to be served once a turn.
  [[nodiscard]] StateRequests& states() { return states_; }
  /// Clients that wait receive progress, when it is time, or the end that they wait for.
  void ShowProgress(const FleetView& view);
  /// The instant at which ShowProgress or states() is due; kNever while no client waits.
  [[nodiscard]] HostInstant wake_at() const {
    if (states_.due()) return HostInstant{0};
    return waiting_ > 0 || dry_run_ ? progress_at_ : kNever;
  }
  /// All clients that wait receive that the daemon ends, and the store's reader is closed, so that
  /// the writer closes last and leaves one file. Pre: the reader's thread has ended.
  void Close();

 private:
  struct Pending {
    ClientId client = 0;
    std::uint64_t id = 0;  // number of the client's request
    bool wait = false;
    bool is_configuration = false;  // apply, home or measure: its summary is the configuration
    bool is_retarget = false;
    bool began = false;            // the coordinator has begun it
    std::string note;              // stands after the answer's text
    std::uint64_t awaits = 0;      // of `wait`: the configuration whose end is the answer
    HostInstant give_up = kNever;  // of `wait`
  };
  /// A request, and who makes it.
  struct Asked {
    const ControlRequest& request;
    const Caller& caller;
  };
  /// A dry run while the planner has it.
  struct DryRun {
    Pending pending;
    std::uint32_t targeted = 0;
    std::vector<Preview::Refused> refused = {};
    HostInstant since;
    std::optional<PlanJob> job = {};  // until it is taken
  };

  void Handle(const FleetView& view, const IncomingLine& line, std::vector<Command>* commands);
  void Do(const FleetView& view, const IncomingLine& line, const Asked& asked,
          std::vector<Command>* commands);
  /// The refusal is logged and kept.
  void NoteRefusal(const FleetView& view, const IncomingLine& line, const Asked& asked,
                   const Error& why);
  void Wait(const FleetView& view, const ControlRequest& request, Pending pending);
  void AnswerWaiters(const FleetView& view);
  /// The dry run is with the planner. Errors: as `apply`; kFull: another one is.
  Status Plan(const FleetView& view, const ControlRequest& request, const Pending& pending);
  /// The answer to a question; none: the verb is no question.
  std::optional<Result<Json>> Ask(const FleetView& view, const ControlRequest& request);
  void Queue(const Pending& pending, Result<StoreReading> reading);
  /// The command that keeps a change of the model; none: the verb changes no model.
  std::optional<Result<Command>> ChangeModel(const FleetView& view, const ControlRequest& request);
  Result<StoreReader*> Reader();
  void Answer(const Pending& pending, const Result<Json>& result);
  void Send(ClientId client, const std::string& answer);

  std::unique_ptr<LineExchange> server_;
  Options options_;
  std::unique_ptr<StoreReader> reader_;  // of changes of the model; opened with the first
  std::deque<StoreQuestion> questions_;  // not handed over yet
  std::unordered_map<std::uint64_t, Pending> asked_;    // by the number of the question
  std::unordered_map<std::uint64_t, Pending> pending_;  // by the coordinator's request number
  std::uint64_t next_request_ = 1;
  std::size_t waiting_ = 0;  // entries of pending_ that get progress
  HostInstant progress_at_{0};
  std::vector<IncomingLine> stops_;
  bool stopped_ = false;         // the last turn handled stops alone
  std::size_t spent_bytes_ = 0;  // in this turn
  LogLimit refusals_;
  StateRequests states_;
  std::optional<DryRun> dry_run_;
};

}  // namespace focalfleet
