#include "daemon/simulator/interface_names.h"

namespace focalfleet::simulator {
namespace {

constexpr std::size_t kInterfacesMax = 100'000;

std::vector<std::string> Split(const std::string& text, char separator) {
  std::vector<std::string> pieces;
  std::size_t begin = 0;
  for (std::size_t end = 0; end != std::string::npos; begin = end + 1) {
    end = text.find(separator, begin);
    pieces.push_back(text.substr(begin, end == std::string::npos ? end : end - begin));
  }
  return pieces;
}

}  // namespace

Result<std::vector<std::string>> ParseInterfaces(const std::string& text) {
  std::vector<std::string> names;
  for (const std::string& piece : Split(text, ',')) {
    const std::size_t dots = piece.find("...");
    if (dots == std::string::npos) {
      if (piece.empty()) return Fail(ErrorCode::kInvalid, "--bus: an interface name is empty");
      names.push_back(piece);
      continue;
    }
    const std::string first = piece.substr(0, dots);
    const std::string last = piece.substr(dots + 3);
    const std::size_t digits = first.find_last_not_of("0123456789") + 1;
    const std::string stem = first.substr(0, digits);
    unsigned low = 0;
    unsigned high = 0;
    if (stem.empty() || last.substr(0, digits) != stem || !Parse(first.substr(digits), &low) ||
        !Parse(last.substr(digits), &high) || high < low || high - low >= kInterfacesMax)
      return Fail(ErrorCode::kInvalid, "--bus: '" + piece + "' is no range such as vcan0...vcan49");
    for (unsigned i = low; i <= high; ++i) names.push_back(stem + std::to_string(i));
  }
  return names;
}

}  // namespace focalfleet::simulator
