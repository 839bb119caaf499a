// Context is shared by all commands: the daemon's socket, and how to write to the caller. Output
// has one rule. stdout carries the answer (with --json exactly one JSON object), stderr carries
// everything else.
#pragma once

#include <cstdio>
#include <optional>
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
  std::string socket;               // as given; empty: $FOCALFLEET_SOCKET, else the installed place
  std::string colour = "auto";      // auto, always, never
  std::optional<double> timeout_s;  // of the daemon's silence; none: as the command has it
  bool colour_out = false;
  bool colour_err = false;
  bool terminal_out = false;
  bool terminal_err = false;
  bool stdout_is_file = false;  // with --out -: other messages go to stderr

  [[nodiscard]] std::string SocketPath() const;
  /// As SocketPath; empty where neither option nor environment names a socket.
  [[nodiscard]] std::string NamedSocketPath() const;
  /// Determines from --color, the terminals and NO_COLOR whether colours are used.
  void LookAtTerminals();
};

inline constexpr const char* kDefaultSocket = "/run/focalfleet/control.sock";
inline constexpr const char* kDefaultConfig = "/etc/focalfleet/focalfleet.toml";

std::string Paint(bool colour_on, Colour colour, std::string_view text);

/// Writes to stdout, at once: lines of text and the colours of Paint, whatever `text` holds
/// (control/printable.h).
void PrintText(std::string_view text);
/// Writes as PrintText, in place of all that the terminal shows.
void PrintScreen(std::string_view text);
/// errno of the first text that stdout refused, else 0. Main reports it: an answer that was not
/// written is a failure.
int OutputError();

/// Writes as PrintText, to stderr. A failure to write is ignored, since no stream is left for a
/// report.
void Complain(std::string_view text);
/// Writes as Complain, in place of the line that the cursor is in.
void RedrawLine(std::string_view text);

/// Writes to stdout; nothing with --quiet or --json.
void Say(const Context& context, std::string_view line);

/// Names ignored columns on stderr: a misspelt column would otherwise be ignored without a message.
/// Nothing with --quiet or --json.
void ReportPassedOver(const Context& context, const std::string& file,
                      const std::vector<std::string>& columns);

/// With --quiet the summary does not name the units that were not served, so stderr does; with
/// --json the object does.
void NameUnserved(const Context& context, std::string_view lines);

/// Prints the single JSON object of a command that was called with --json. Text that is not UTF-8
/// is replaced.
void PrintJson(const Json& object);

/// Reports the reason of a failure on stderr, and with --json also as
/// {"error":{code,text},"exit":n} on stdout. Returns its exit code.
ExitCode Report(const Context& context, const Failure& failure);
ExitCode Report(const Context& context, const Error& error, ExitCode exit = ExitCode::kRefused);

/// The number with its noun: 1 unit, 2 units.
std::string Count(std::uint64_t n, const char* singular, const char* plural);

}  // namespace focalfleet::cli
