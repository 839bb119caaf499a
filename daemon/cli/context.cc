#include "daemon/cli/context.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>

#include "daemon/control/printable.h"

namespace focalfleet::cli {
namespace {

// The form of all answers (docs/schemas/). A member that is added keeps the number; where a member
// changes or goes, the number rises.
constexpr int kAnswerSchema = 1;

int output_error = 0;  // one a process, as standard output itself

void Write(std::string_view text) {
  const bool written =
      std::fwrite(text.data(), 1, text.size(), stdout) == text.size() && std::fflush(stdout) == 0;
  if (!written && output_error == 0) output_error = errno;
}

constexpr std::array kCodes = {"\033[0m", "\033[32m", "\033[33m", "\033[31m", "\033[1m"};

/// The text as lines, without any terminal control but the colours that Paint makes.
std::string ForTerminal(std::string_view text) {
  std::string out;
  while (!text.empty()) {
    const std::size_t plain = text.find('\033');
    out += PrintableLines(text.substr(0, plain));
    text.remove_prefix(std::min(plain, text.size()));
    if (text.empty()) break;
    const auto code = std::ranges::find_if(
        kCodes, [text](std::string_view known) { return text.starts_with(known); });
    const std::size_t bytes = code != kCodes.end() ? std::string_view(*code).size() : 1;
    out += code != kCodes.end() ? std::string(*code) : PrintableLines(text.substr(0, bytes));
    text.remove_prefix(bytes);
  }
  return out;
}

}  // namespace

std::string Context::NamedSocketPath() const {
  if (!socket.empty()) return socket;
  const char* from_environment = std::getenv("FOCALFLEET_SOCKET");
  return from_environment != nullptr ? from_environment : "";
}

std::string Context::SocketPath() const {
  const std::string named = NamedSocketPath();
  return named.empty() ? kDefaultSocket : named;
}

void Context::LookAtTerminals() {
  terminal_out = isatty(STDOUT_FILENO) == 1;
  terminal_err = isatty(STDERR_FILENO) == 1;
  const char* no_colour = std::getenv("NO_COLOR");
  const bool unwanted = colour == "never" || (no_colour != nullptr && *no_colour != '\0');
  const bool always = colour == "always";  // the option is nearer than the environment
  colour_out = (always || (!unwanted && terminal_out)) && !json;
  colour_err = always || (!unwanted && terminal_err);
}

std::string Paint(bool colour_on, Colour colour, std::string_view text) {
  if (!colour_on || colour == Colour::kPlain) return std::string(text);
  return fmt::format("{}{}{}", kCodes[static_cast<std::size_t>(colour)], text, kCodes[0]);
}

void PrintText(std::string_view text) { Write(ForTerminal(text)); }

void PrintScreen(std::string_view text) { Write("\033[H\033[2J" + ForTerminal(text)); }

int OutputError() { return output_error; }

// fmt::print is not used: it throws where the stream accepts nothing.
void Complain(std::string_view text) {
  const std::string clean = ForTerminal(text);
  std::fwrite(clean.data(), 1, clean.size(), stderr);
}

void RedrawLine(std::string_view text) {
  std::fputs("\r\033[K", stderr);
  Complain(text);
}

void Say(const Context& context, std::string_view line) {
  if (context.quiet || context.json) return;
  const std::string text = fmt::format("{}\n", line);
  if (context.stdout_is_file) {
    Complain(text);
  } else {
    PrintText(text);
  }
}

void ReportPassedOver(const Context& context, const std::string& file,
                      const std::vector<std::string>& columns) {
  if (columns.empty() || context.quiet || context.json) return;
  constexpr std::size_t kReported = 20;
  const std::size_t reported = std::min(columns.size(), kReported);
  const std::string names = fmt::format(
      "{}",
      fmt::join(columns.begin(), columns.begin() + static_cast<std::ptrdiff_t>(reported), ", "));
  const std::string more =
      columns.size() > reported ? fmt::format(" and {} more", columns.size() - reported) : "";
  Complain(fmt::format("focalfleet: {}: columns passed over: {}{}\n", file, names, more));
}

void NameUnserved(const Context& context, std::string_view lines) {
  if (lines.empty() || !context.quiet || context.json) return;
  Complain(fmt::format("focalfleet: not served:\n{}\n", lines));
}

void PrintJson(const Json& object) {
  Json answer = object;
  answer["schema"] = kAnswerSchema;
  Write(PrintableJson(answer.dump(-1, ' ', false, Json::error_handler_t::replace)) + "\n");
}

ExitCode Report(const Context& context, const Failure& failure) {
  Complain(fmt::format("focalfleet: {} {}\n", Paint(context.colour_err, Colour::kRed, "error:"),
                       failure.error.text));
  if (context.json) {
    PrintJson({{"error", {{"code", CodeName(failure.error.code)}, {"text", failure.error.text}}},
               {"exit", static_cast<int>(failure.exit)}});
  }
  return failure.exit;
}

ExitCode Report(const Context& context, const Error& error, ExitCode exit) {
  return Report(context, Failure{exit, error});
}

std::string Count(std::uint64_t n, const char* singular, const char* plural) {
  return fmt::format("{} {}", n, n == 1 ? singular : plural);
}

}  // namespace focalfleet::cli
