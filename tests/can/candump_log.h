// ParseCandump reads the output of `candump -l`, line by line: "(1436509052.249713) vcan0
// 1ABCDEF0#0011223344". Only 29-bit data frames are focalfleet's. Other frames are counted apart
// from lines that are no candump at all.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/wire/can_frame.h"

namespace focalfleet::test {

struct LoggedFrame {
  std::int64_t at_us = 0;
  std::string interface;
  CanFrame frame;
};

struct CandumpLog {
  std::vector<LoggedFrame> frames;
  int foreign = 0;  // 11-bit, remote and error frames, CAN FD that is no group
};

/// The frames of a log.
/// Errors: kInvalid, names the line.
Result<CandumpLog> ParseCandump(const std::string& text);

}  // namespace focalfleet::test
