// How far a long command is, on stderr. On a terminal one line that is drawn over; into a file or
// pipe one plain line when the state changes and at each tenth of the way; with --json or --quiet
// nothing.
#pragma once

#include <string>
#include <string_view>

#include "daemon/cli/context.h"

namespace focalfleet::cli {

/// `[######----]  60 %  text`, at most `columns` wide. Fractions outside 0..1 (and NaN) are
/// clipped.
std::string DrawBar(double fraction, std::string_view text, std::size_t columns);

class ProgressBar {
 public:
  explicit ProgressBar(const Context& context);
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;
  ~ProgressBar();

  /// `stage` is what is being done (its change makes a plain line), `text` the details.
  void Show(double fraction, const std::string& stage, const std::string& text);

  /// Leaves the line, so that other text can follow. The destructor does the same.
  void End();

 private:
  enum class Kind { kNone, kPlain, kTerminal };
  Kind kind_ = Kind::kNone;
  bool drawn_ = false;
  std::string stage_;
  int tenth_ = -1;
};

}  // namespace focalfleet::cli
