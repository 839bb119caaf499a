#include "daemon/cli/confirm.h"

#include <unistd.h>

#include <iostream>

namespace focalfleet::cli {

std::optional<Failure> Refused(const std::string& what, bool yes) {
  if (yes || ::isatty(STDIN_FILENO) == 0) return std::nullopt;
  Complain("focalfleet: " + what + ". Go on? [y/N] ");
  std::string answer;
  std::getline(std::cin, answer);
  if (answer == "y" || answer == "Y" || answer == "yes") return std::nullopt;
  return Failure{ExitCode::kRefused, {ErrorCode::kRefused, "not confirmed; nothing was done"}};
}

}  // namespace focalfleet::cli
