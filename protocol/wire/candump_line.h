// One line as candump writes it, in both of its forms:
//
//   (1436509052.249713) vcan0 1ABCDEF0#0011223344              candump -l, -L
//    (1436509052.249713)  vcan0  TX - -  1ABCDEF0   [5]  00 11 22 33 44   candump, -t, -x, -a
//   (1436509052.249713) vcan0 1107F800##1FFFFFFFF                        CAN FD, and 1 for its
//   flags
//
// Only classic data frames with 29-bit identifiers are focalfleet's, and CAN FD frames with the
// identifier of groups; the others are told apart from lines that candump does not write.
#pragma once

#include <optional>
#include <string_view>
#include <tl/expected.hpp>

#include "protocol/wire/can_frame.h"
#include "protocol/wire/stage_group.h"

namespace focalfleet {

struct CandumpLine {
  std::string_view time;  // as it stands between the parentheses; empty where there is none
  std::string_view interface;
  const char* foreign = nullptr;  // what kind of frame this is; null: one of ours, in `frame`
  CanFrame frame;
  std::optional<FdFrame> group;  // in place of `frame`; of as many bytes as the line has
};

/// Lifetime: as the line's. Errors: what is wrong with it, for people.
tl::expected<CandumpLine, const char*> ParseCandumpLine(std::string_view line);

}  // namespace focalfleet
