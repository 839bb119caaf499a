// The faults of all rows of a table, so that one message is enough to correct the file. The first
// limits::kBadRowsReported rows are listed in full, one a line; the others are counted by kind of
// fault:
//
//   t.csv:11: unit 10: x_mm 52.3, y_mm 0.1 is 45 mm from its base (out of patrol, ...)
//     t.csv:21: unit 20: unknown unit, the layout has none such
//     and 3387 more rows; all 3389: out of patrol (3377), unknown unit (12)
//
// The text stays below some 10 kB whatever is in the file, and no cell adds a line of its own.
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"

namespace focalfleet {

class BadRows {
 public:
  /// Adds a row. `text` is the place and the fault; rows with the same `kind` are counted together.
  void Add(std::string_view text, std::string_view kind);
  [[nodiscard]] bool empty() const { return count_ == 0; }
  /// Errors: kInvalid where a row was added.
  [[nodiscard]] Status Check() const;

 private:
  [[nodiscard]] std::string Totals() const;

  std::vector<std::string> reported_;
  std::size_t count_ = 0;
  std::map<std::string, std::size_t> of_kind_;
};

/// The first line of a message for a log, and how many lines follow.
std::string FirstRow(std::string_view text);

}  // namespace focalfleet
