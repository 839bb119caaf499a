#include "daemon/control/id_ranges.h"

#include <algorithm>
#include <charconv>
#include <string_view>

namespace focalfleet {
namespace {

constexpr std::size_t kNumbersMax = 100'000;

bool Parse(std::string_view text, std::uint32_t* number) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), *number);
  return error == std::errc() && end == text.data() + text.size();
}

}  // namespace

Result<std::vector<std::uint32_t>> ParseRanges(const std::string& text) {
  std::vector<std::uint32_t> numbers;
  for (std::size_t begin = 0, end = 0; end != std::string::npos; begin = end + 1) {
    end = text.find(',', begin);
    const std::string_view piece = std::string_view(text).substr(
        begin, end == std::string::npos ? std::string::npos : end - begin);
    const std::size_t dash = piece.find('-');
    std::uint32_t low = 0;
    std::uint32_t high = 0;
    const bool one = dash == std::string_view::npos && Parse(piece, &low);
    if (one) high = low;
    const bool range = dash != std::string_view::npos && Parse(piece.substr(0, dash), &low) &&
                       Parse(piece.substr(dash + 1), &high);
    if ((!one && !range) || high < low || high - low >= kNumbersMax)
      return Fail(ErrorCode::kInvalid,
                  "'" + std::string(piece) + "' is neither a number nor a range such as 5-9");
    for (std::uint64_t i = low; i <= high; ++i) numbers.push_back(static_cast<std::uint32_t>(i));
    if (numbers.size() > kNumbersMax) return Fail(ErrorCode::kInvalid, "too many numbers");
  }
  return numbers;
}

std::string DescribeRanges(std::vector<std::uint32_t> numbers, std::size_t pieces_max) {
  std::ranges::sort(numbers);
  numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
  std::string text;
  std::size_t pieces = 0;
  for (std::size_t first = 0, last = 0; first < numbers.size(); first = last + 1) {
    if (pieces++ == pieces_max) return text + ",...";
    last = first;
    while (last + 1 < numbers.size() && numbers[last + 1] == numbers[last] + 1) ++last;
    if (!text.empty()) text += ',';
    text += std::to_string(numbers[first]);
    // Two neighbours are as short as a list.
    if (last > first) text += (last == first + 1 ? "," : "-") + std::to_string(numbers[last]);
  }
  return text;
}

}  // namespace focalfleet
