// A limit on lines that strangers cause in the log: so many a minute, then one that counts the
// rest. Time is an argument.
#pragma once

#include <cstdint>
#include <string>

#include "protocol/base/instants.h"

namespace focalfleet {

class LogLimit {
 public:
  explicit LogLimit(std::uint32_t lines_per_minute = 10) : most_(lines_per_minute) {}

  /// The line to log; empty: none. After a minute with lines that were left out, the next line
  /// tells their number.
  std::string Admit(DurationNs now, const std::string& line);

 private:
  std::uint32_t most_;
  DurationNs began_{0};
  std::uint32_t lines_ = 0;
  std::uint64_t left_out_ = 0;
};

}  // namespace focalfleet
