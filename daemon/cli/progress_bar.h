// ProgressBar shows the progress of a long command on stderr. A terminal gets a line that is
// redrawn. A file or pipe gets a plain line when the state changes and at each tenth of the way.
// With --json or --quiet nothing is shown.
#pragma once

#include <string>
#include <string_view>

#include "daemon/cli/context.h"

namespace focalfleet::cli {

/// The text `[######----]  60 %  text`, at most `columns` wide. Fractions outside 0..1 (and NaN)
/// are clipped.
std::string DrawBar(double fraction, std::string_view text, std::size_t columns);

class ProgressBar {
 public:
  explicit ProgressBar(const Context& context);
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;
  ~ProgressBar();

  /// Shows the progress. `stage` is the current activity (its change makes a plain line), `text`
  /// the details.
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
