// One line as candump writes it, in both of its forms:
//
//   (1436509052.249713) vcan0 1ABCDEF0#0011223344              candump -l, -L
//    (1436509052.249713)  vcan0  TX - -  1ABCDEF0   [5]  00 11 22 33 44   candump, -t, -x, -a
//   (1436509052.249713) vcan0 1107F800##1FFFFFFFF                        CAN FD, and 1 for its
//   flags
//
// Bytes may stand in binary (-i) or from the last one on (-S), lines in colours (-c), and behind an
// error frame its words, a line each (-e). Lines without a frame are notes.
//
// Only classic data frames with 29-bit identifiers are focalfleet's, and CAN FD frames with the
// identifier of groups; the others are told apart from lines that candump does not write.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
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

/// A line in which candump says something besides frames.
struct CandumpNote {
  enum class Kind : std::uint8_t {
    kErrorWords,  // of the error frame in the line before
    kDropped,     // frames that the kernel had no room for: they are missing in the log
    kOther,       // of its log file, its buffers, an interface that is down
  };
  Kind kind = Kind::kOther;
  std::string_view text;       // the words
  std::string_view interface;  // of kDropped
  std::int64_t dropped = 0;
  std::int64_t dropped_total = 0;
};

/// Nothing: the line is no note. Lifetime: as the line's.
std::optional<CandumpNote> ParseCandumpNote(std::string_view line);

/// The line without colours, the moving sign of -s 1, and the warning that has no line of its own.
std::string WithoutDecoration(std::string_view line);

}  // namespace focalfleet
