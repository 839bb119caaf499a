// Where the control socket meets the coordinator: requests become commands or are answered from
// what is known; replies of the coordinator become answers; whoever waits for a configuration is
// shown how it goes. All of it runs on the core thread, so that every answer is about one instant.
//
// A stop goes before everything else that was read, in every turn, from behind other lines of its
// client, too. In the turn that brings one no other line is handled, so that its frames are on the
// buses before anything is reckoned for people; only behind a second one in a row are others heard.
// Requests of other verbs share a budget a turn (kTurnBytes); behind it, buses, signals and the
// next stop are looked at first. Motions that a stop overtook are refused: the stop was meant for
// them, too.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "daemon/control/line_server.h"
#include "daemon/status/shell_facts.h"
#include "daemon/status/status_snapshot.h"
#include "daemon/store/store_reader.h"
#include "daemon/verbs/model_registry.h"
#include "fleet/coordinator.h"

namespace focalfleet {

class RequestHandler {
 public:
  struct Options {
    DurationNs progress_period = Milliseconds(200);
    std::function<ShellFacts()> facts;
    std::function<void(const std::string&)> log;  // one sentence for each command
    std::string store_path;
    ModelRegistry* models = nullptr;  // outlives the handler
  };
  RequestHandler(LineServer server, Options options)
      : server_(std::move(server)), options_(std::move(options)) {}

  /// Bytes of lines and answers of one turn, after which no further line is taken: a turn ends with
  /// the line that exceeds them. The cost goes by the bytes, 10 to 30 ns each: so much is a
  /// millisecond. Half of it makes two turns of most answers to `status`; twice as much lets a stop
  /// wait a millisecond longer behind them. One `state` of 5000 units exceeds it by far.
  static constexpr std::size_t kTurnBytes = std::size_t{64} << 10;
  /// Cost of a line by itself, however short: some 20 us of parsing, system calls and bookkeeping,
  /// as bytes.
  static constexpr std::size_t kLineBytes = 1024;

  /// A stop, as LineServer::Options::urgent wants it. One that is written more lavishly than
  /// programs do (over 512 bytes, or escapes in the word) is no less done, but in its turn.
  static bool IsStop(std::string_view line);

  [[nodiscard]] int fd() const { return server_.fd(); }

  /// Does a turn: reads requests, answers questions, appends commands.
  void Service(const FleetView& view, std::vector<Command>* commands);
  void Reply(const FleetView& view, const ReplyEffect& reply);
  /// Shows progress to those who wait, when it is time.
  void ShowProgress(const FleetView& view);
  /// When ShowProgress wants to be called; kNever while nobody waits.
  [[nodiscard]] HostInstant wake_at() const { return waiting_ > 0 ? progress_at_ : kNever; }
  /// Tells all who wait that the daemon ends, and leaves the store: whoever closes it last makes
  /// one file of it.
  void Close();

 private:
  struct Pending {
    ClientId client = 0;
    std::uint64_t id = 0;  // of the client's request
    bool wait = false;
    bool is_configuration = false;  // apply, home or measure: its summary is the configuration
    bool is_retarget = false;
    bool began = false;  // and the coordinator took it up
    std::string note;    // to go after the answer's text
  };

  void Handle(const FleetView& view, const IncomingLine& line, std::vector<Command>* commands);
  /// None: the verb is no question.
  std::optional<Result<Json>> Ask(const FleetView& view, const ControlRequest& request);
  Result<Json> AskUnit(const FleetView& view, const ControlRequest& request);
  Result<Json> AskParameters(const FleetView& view, const ControlRequest& request);
  Result<Json> AskHistory(const FleetView& view, const ControlRequest& request);
  Result<Json> AskMeasurements(const FleetView& view, const ControlRequest& request);
  /// None: the verb changes no model.
  std::optional<Result<Command>> ChangeModel(const FleetView& view, const ControlRequest& request);
  [[nodiscard]] std::string NoteOn(const FleetView& view, const Command& command) const;
  Result<StoreReader*> Reader();
  void Answer(const Pending& pending, const Result<Json>& result);
  void Send(ClientId client, const std::string& answer);

  LineServer server_;
  Options options_;
  std::unique_ptr<StoreReader> reader_;                 // opened with the first question for it
  std::unordered_map<std::uint64_t, Pending> pending_;  // by the coordinator's request number
  std::uint64_t next_request_ = 1;
  std::size_t waiting_ = 0;  // of pending_, those that wait
  HostInstant progress_at_{0};
  std::vector<IncomingLine> stops_;
  bool stopped_ = false;         // the last turn was for stops alone
  std::size_t spent_bytes_ = 0;  // in this turn
};

}  // namespace focalfleet
