#include "daemon/ports/bounded_question.h"

#include <string>
#include <system_error>
#include <utility>

namespace focalfleet {

BoundedQuestion::Answer BoundedQuestion::operator()(std::function<Answer()> ask) {
  const auto open = std::make_shared<Open>();
  {
    const std::lock_guard lock(lock_);
    if (open_ != nullptr) {
      const std::lock_guard of_earlier(open_->lock);
      if (!open_->over)
        return Fail(ErrorCode::kUnavailable, "the kernel has not answered the question before");
    }
    open_ = open;
  }
  try {
    options_
        .start([open, ask = std::move(ask)] {
          Answer answer = ask();
          const std::lock_guard lock(open->lock);
          open->answer = std::move(answer);
          open->over = true;
          open->done.notify_all();
        })
        .detach();
  } catch (const std::system_error& error) {
    const std::lock_guard lock(open->lock);
    open->over = true;
    return Fail(ErrorCode::kUnavailable, std::string("no thread to ask by: ") + error.what());
  }
  std::unique_lock lock(open->lock);
  if (open->done.wait_for(lock, options_.patience, [&] { return open->over; }))
    return std::move(open->answer);
  return Fail(ErrorCode::kUnavailable, "the kernel does not answer within " +
                                           std::to_string(options_.patience.count()) + " ms");
}

}  // namespace focalfleet
