#include "daemon/verbs/state_requests.h"

#include <utility>

#include "daemon/control/messages.h"

namespace focalfleet {

Status StateRequests::Add(ClientId client, std::uint64_t id) {
  if (asked_.size() >= kOpenRequestsMax)
    return Fail(ErrorCode::kFull, std::to_string(asked_.size()) +
                                      " requests wait for the state; ask again in a second");
  asked_.push_back({client, id});
  return {};
}

void StateRequests::Serve(const FleetView& view, const std::function<bool(StateRows*)>& submit) {
  if (text_ && !awaiting_.empty()) {
    Answer(awaiting_.back());
    awaiting_.pop_back();
    if (awaiting_.empty()) text_.reset();
  }
  if (!awaiting_.empty() || asked_.empty()) return;
  StateRows rows = TakeStateRows(view);
  if (!submit(&rows)) return;
  awaiting_ = std::exchange(asked_, {});
}

void StateRequests::Answer(const Asker& asker) {
  if (text_->empty()) {
    server_->Answer(asker.client,
                    EncodeError(asker.id, {ErrorCode::kUnavailable, "the state found no memory"}));
    return;
  }
  // The answer is spliced in as text, into the frame that EncodeResult makes.
  std::string answer = EncodeResult(asker.id, nullptr);
  answer.replace(answer.find("null"), 4, *text_);
  server_->Answer(asker.client, answer);
}

void StateRequests::Close(const Error& why) {
  for (auto* const askers : {&asked_, &awaiting_})
    for (const Asker& asker : std::exchange(*askers, {}))
      server_->Answer(asker.client, EncodeError(asker.id, why));
}

}  // namespace focalfleet
