#include "daemon/access/log_limit.h"

#include <utility>

namespace focalfleet {

std::string LogLimit::Admit(DurationNs now, const std::string& line) {
  constexpr std::int64_t kMinuteNs = 60'000'000'000;
  if (lines_ == 0 || now.ns - began_.ns >= kMinuteNs || now.ns < began_.ns) {
    began_ = now;
    lines_ = 0;
  }
  if (lines_ >= most_) {
    ++left_out_;
    return {};
  }
  ++lines_;
  if (left_out_ == 0) return line;
  return line + " (" + std::to_string(std::exchange(left_out_, 0)) + " such lines were left out)";
}

}  // namespace focalfleet
