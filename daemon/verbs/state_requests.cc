#include "daemon/verbs/state_requests.h"

#include <algorithm>
#include <utility>

#include "daemon/control/messages.h"

namespace focalfleet {

Status StateRequests::Add(ClientId client, std::uint64_t id) {
  const auto is_its_own = [&](const Asker& asker) { return asker.client == client; };
  if (std::ranges::any_of(asked_, is_its_own) || std::ranges::any_of(awaiting_, is_its_own))
    return Fail(ErrorCode::kFull, "this client waits for the state already");
  std::erase_if(asked_, [&](const Asker& asker) { return !server_->connected(asker.client); });
  asked_.push_back({client, id});
  return {};
}

void StateRequests::Serve(const FleetView& view, const std::function<bool(StateRows*)>& submit) {
  if (text_) {
    std::erase_if(awaiting_, [&](const Asker& asker) { return !server_->connected(asker.client); });
    if (!awaiting_.empty()) {
      Answer(awaiting_.front());
      awaiting_.erase(awaiting_.begin());
    }
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
