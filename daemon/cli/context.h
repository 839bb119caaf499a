// What every command shares: where the daemon listens and how to speak to the caller. One rule for
// output: stdout carries the answer (with --json exactly one JSON object), stderr carries
// everything else.
#pragma once

#include <cstdio>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/cli/exit_code.h"
#include "daemon/control/messages.h"

namespace focalfleet::cli {

enum class Colour { kPlain, kGreen, kYellow, kRed, kBold };

struct Context {
  bool json = false;
  bool quiet = false;
  std::string socket;  // as given; empty: $FOCALFLEET_SOCKET, else the installed place
  bool colour_out = false;
  bool colour_err = false;
  bool terminal_out = false;
  bool terminal_err = false;
  bool stdout_is_file = false;  // --out -: what is said beside it goes to stderr

  [[nodiscard]] std::string SocketPath() const;
  /// Looks at the terminals and NO_COLOR.
  void LookAtTerminals();
};

inline constexpr const char* kDefaultSocket = "/run/focalfleet/control.sock";

std::string Paint(bool colour_on, Colour colour, std::string_view text);

/// Writes to stdout, at once: lines of text and the colours of Paint, whatever `text` holds
/// (control/printable.h).
void PrintText(std::string_view text);
/// As PrintText, in place of all that the terminal shows.
void PrintScreen(std::string_view text);
/// errno of the first text that stdout did not take, else 0. Main tells it: an answer that nobody
/// got is not done.
int OutputError();

/// Writes to stderr what PrintText would. Where that takes nothing, there is nobody to tell.
void Complain(std::string_view text);
/// As Complain, in place of the line that the cursor is in.
void RedrawLine(std::string_view text);

/// Writes to stdout; nothing with --quiet or --json.
void Say(const Context& context, std::string_view line);

/// A misspelt column is one that nobody reads: it must not pass in silence. To stderr; nothing with
/// --quiet or --json.
void ReportPassedOver(const Context& context, const std::string& file,
                      const std::vector<std::string>& columns);

/// With --quiet the summary does not name the units that were not served, so stderr does; with
/// --json the object does.
void NameUnserved(const Context& context, std::string_view lines);

/// The one JSON object of a command that was called with --json. Text that is not UTF-8 is
/// replaced.
void PrintJson(const Json& object);

/// Tells why, on stderr and with --json also as {"error":{code,text},"exit":n} on stdout.
ExitCode Report(const Context& context, const Failure& failure);
ExitCode Report(const Context& context, const Error& error, ExitCode exit = ExitCode::kRefused);

/// 1 unit, 2 units.
std::string Count(std::uint64_t n, const char* singular, const char* plural);

}  // namespace focalfleet::cli
