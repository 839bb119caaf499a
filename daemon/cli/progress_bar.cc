#include "daemon/cli/progress_bar.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>

namespace focalfleet::cli {
namespace {

std::size_t Columns() {
  struct winsize size {};
  if (ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 20) return size.ws_col;
  return 80;
}

double Clip(double fraction) { return fraction > 0 ? std::min(fraction, 1.0) : 0.0; }

}  // namespace

std::string DrawBar(double fraction, std::string_view text, std::size_t columns) {
  constexpr std::size_t kBarWidth = 28;
  const double f = Clip(fraction);
  const auto filled = static_cast<std::size_t>(f * kBarWidth);
  std::string line = fmt::format("[{}{}] {:3.0f} %  {}", std::string(filled, '#'),
                                 std::string(kBarWidth - filled, '-'), 100 * f, text);
  if (line.size() > columns) line.resize(columns);
  return line;
}

ProgressBar::ProgressBar(const Context& context)
    : kind_(context.json || context.quiet ? Kind::kNone
            : context.terminal_err        ? Kind::kTerminal
                                          : Kind::kPlain) {}

ProgressBar::~ProgressBar() { End(); }

void ProgressBar::End() {
  if (drawn_) Complain("\n");
  drawn_ = false;
}

void ProgressBar::Show(double fraction, const std::string& stage, const std::string& text) {
  if (kind_ == Kind::kNone) return;
  const std::string details = fmt::format("{}  {}", stage, text);
  if (kind_ == Kind::kTerminal) {
    // The last column is left free: a full line makes some terminals wrap.
    RedrawLine(DrawBar(fraction, details, Columns() - 1));
    std::fflush(stderr);
    drawn_ = true;
    return;
  }
  const int tenth = static_cast<int>(10 * Clip(fraction));
  if (stage == stage_ && tenth == tenth_) return;
  stage_ = stage;
  tenth_ = tenth;
  Complain(fmt::format("{:3.0f} %  {}\n", 100 * Clip(fraction), details));
  std::fflush(stderr);
}

}  // namespace focalfleet::cli
