// Everything that is wrong with the rows of a table, so that one message mends the file. The first
// limits::kBadRowsTold rows are told in full, one a line; the others are counted by what is wrong
// with them:
//
//   t.csv:11: unit 10: x_mm 52.3, y_mm 0.1 is 45 mm from its base (out of patrol, ...)
//     t.csv:21: unit 20: unknown unit, the layout has none such
//     and 3387 more rows; all 3389: out of patrol (3377), unknown unit (12)
//
// The text stays below some 10 kB whatever is in the file, and no cell puts a line of its own into
// it.
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
  /// `text` says where and why; rows with the same `kind` are counted together.
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

/// A message with several lines as a log tells it: the first, and how many follow.
std::string FirstRow(std::string_view text);

}  // namespace focalfleet
