// A line as candump writes it, in both of its forms:
//
//   (1436509052.249713) vcan0 1ABCDEF0#0011223344              candump -l, -L
//    (1436509052.249713)  vcan0  TX - -  1ABCDEF0   [5]  00 11 22 33 44   candump, -t, -x, -a
//   (1436509052.249713) vcan0 1107F800##1FFFFFFFF              CAN FD, 1 for its flags
//
// Bytes may stand in binary (-i) or in reverse order (-S), and lines in colours (-c). With -e the
// words of an error frame follow it, a line each. Lines without a frame are notes.
//
// Only two kinds of frame are focalfleet's: classic data frames with 29-bit identifiers, and CAN FD
// frames with the identifier of groups. All others parse as `foreign`; a line that candump does not
// write is an error.
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
  std::string_view time;  // the text between the parentheses; empty where there is none
  std::string_view interface;
  const char* foreign =
      nullptr;  // the kind of a foreign frame; null: `frame` or `group` is focalfleet's
  CanFrame frame;
  std::optional<FdFrame> group;  // in place of `frame`; has as many bytes as the line
};

/// Lifetime: that of the line. Errors: what is wrong with the line, for people.
tl::expected<CandumpLine, const char*> ParseCandumpLine(std::string_view line);

/// A line in which candump reports something other than a frame.
struct CandumpNote {
  enum class Kind : std::uint8_t {
    kErrorWords,  // of the error frame in the line before
    kDropped,     // frames that the kernel had no room for: the log lacks them
    kOther,       // about its log file, its buffers, or an interface that is down
  };
  Kind kind = Kind::kOther;
  std::string_view text;       // the words
  std::string_view interface;  // of kDropped
  std::int64_t dropped = 0;
  std::int64_t dropped_total = 0;
};

/// Nothing: the line is no note. Lifetime: that of the line.
std::optional<CandumpNote> ParseCandumpNote(std::string_view line);

/// The line without colours, without the moving sign of -s 1, and without the warning that has no
/// line of its own.
std::string WithoutDecoration(std::string_view line);

}  // namespace focalfleet
