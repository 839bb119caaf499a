// Requests of `state`. The core takes rows of the fleet after it has read a request, and another
// thread makes the text of them (status/state_rows.h). Clients who ask meanwhile share the next
// rows. A turn answers one client: for 5000 units an answer has 2 MB.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "daemon/control/line_exchange.h"
#include "daemon/status/state_rows.h"
#include "protocol/base/result.h"

namespace focalfleet {

class StateRequests {
 public:
  /// `server` outlives it.
  explicit StateRequests(LineExchange* server) : server_(server) {}

  /// The client waits for the state; `id` is the number of its request. Errors: kFull: it does
  /// already, so that a client that does not read has one answer in memory.
  Status Add(ClientId client, std::uint64_t id);
  /// A turn: one client receives the text, where it is there, and the next rows go to `submit`,
  /// where clients wait for them. Rows for which `submit` returns false are taken anew later.
  void Serve(const FleetView& view, const std::function<bool(StateRows*)>& submit);
  /// The text of the rows that were handed over last; empty: it could not be made.
  void Written(std::string text) { text_ = std::move(text); }
  /// Serve has something to do.
  [[nodiscard]] bool due() const { return awaiting_.empty() ? !asked_.empty() : text_.has_value(); }
  /// All who wait receive this error.
  void Close(const Error& why);

 private:
  struct Asker {
    ClientId client = 0;
    std::uint64_t id = 0;
  };
  void Answer(const Asker& asker);

  LineExchange* server_;
  std::vector<Asker> asked_;         // for rows that are not taken yet
  std::vector<Asker> awaiting_;      // the text that is made, or is there
  std::optional<std::string> text_;  // none: it is being made
};

}  // namespace focalfleet
