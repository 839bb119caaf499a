// Where the control socket meets the coordinator: requests become commands or are answered from
// what is known; replies of the coordinator become answers; whoever waits for a configuration is
// shown how it goes. All of it runs on the core thread, so that every answer is about one instant.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "daemon/control/line_server.h"
#include "daemon/model_shelf.h"
#include "daemon/status_json.h"
#include "daemon/store/store.h"
#include "fleet/coordinator.h"

namespace focalfleet {

/// Tells the model what the unit counts, if it rests.
void NoteRest(const FleetView& view, PositionerIndex i, Compensation* compensation);

class ControlDesk {
 public:
  struct Options {
    DurationNs progress_period = Milliseconds(200);
    std::function<ShellFacts()> facts;
    std::function<void(const std::string&)> log;  // one sentence for each command
    std::string store_path;
    const Layout* layout = nullptr;
  };
  ControlDesk(LineServer server, Options options)
      : server_(std::move(server)), options_(std::move(options)), models_(options_.layout) {}

  [[nodiscard]] int fd() const { return server_.fd(); }

  /// Reads requests, answers questions, appends commands.
  void Service(const FleetView& view, std::vector<Command>* commands);
  void Reply(const FleetView& view, const ReplyEffect& reply);
  /// Shows progress to those who wait, when it is time.
  void ShowProgress(const FleetView& view);
  /// When ShowProgress wants to be called; kNever while nobody waits.
  [[nodiscard]] HostInstant wake_at() const { return waiting_ > 0 ? progress_at_ : kNever; }
  /// The model that was in force when the last daemon ended. Errors: those of the store; kInvalid:
  /// it is none of this fleet any more. Then none is in force.
  Status RestoreModel();
  [[nodiscard]] ModelShelf& models() { return models_; }
  [[nodiscard]] const ModelShelf& models() const { return models_; }

  /// Tells all who wait that the daemon ends.
  void Close();

 private:
  struct Pending {
    ClientId client = 0;
    std::uint64_t id = 0;  // of the client's request
    bool wait = false;
    bool pursues = false;  // apply or home: its summary is the configuration
    bool retargets = false;
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
  Status TakeModelChanges();
  /// Units that are not any more what the model in force was measured on go without it: their count
  /// began anew, or other hardware sits there.
  Status ForgetStrangers();
  [[nodiscard]] std::string NoteOn(const FleetView& view, const Command& command) const;
  Result<StoreReader*> Reader();
  void Answer(const Pending& pending, const Result<Json>& result);

  LineServer server_;
  Options options_;
  ModelShelf models_;
  std::unique_ptr<StoreReader> reader_;                 // opened with the first question for it
  std::unordered_map<std::uint64_t, Pending> pending_;  // by the coordinator's request number
  std::uint64_t next_request_ = 1;
  std::size_t waiting_ = 0;  // of pending_, those that wait
  HostInstant progress_at_{0};
  std::vector<IncomingLine> lines_;
};

}  // namespace focalfleet
