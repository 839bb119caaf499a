#include "fleet/files/cell.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <iterator>
#include <system_error>

namespace focalfleet {
namespace {

std::string Lower(std::string_view text) {
  std::string lower(text);
  for (char& c : lower)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return lower;
}

}  // namespace

std::string_view Trimmed(std::string_view text) {
  const auto blank = [](char c) { return c == ' ' || c == '\t'; };
  while (!text.empty() && blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && blank(text.back())) text.remove_suffix(1);
  return text;
}

std::string Quoted(std::string_view cell) {
  constexpr std::size_t kShown = 40;
  std::string shown = "'";
  for (const char c : cell.substr(0, kShown))
    shown += static_cast<unsigned char>(c) < 0x20 || c == 0x7f ? '?' : c;
  return shown + (cell.size() > kShown ? "...'" : "'");
}

bool IsMissing(std::string_view cell) {
  constexpr std::size_t kLongest = 4;
  if (cell.empty() || cell == "--" || cell == "\\N") return true;
  if (cell.size() > kLongest) return false;
  const std::string word = Lower(cell);
  constexpr std::string_view kWords[] = {"nan", "null", "none", "n/a", "na", "<na>"};
  return std::ranges::find(kWords, word) != std::end(kWords);
}

std::optional<double> ParseNumber(std::string_view cell) {
  if (cell.starts_with('+') && !cell.starts_with("+-")) cell.remove_prefix(1);
  double value = 0;
  const char* const end_of_cell = cell.data() + cell.size();
  const auto [end, problem] = std::from_chars(cell.data(), end_of_cell, value);
  if (problem == std::errc() && end == end_of_cell) return value;
  // Fortran writes the exponent of a double behind a D.
  if (problem != std::errc() || (*end != 'D' && *end != 'd')) return std::nullopt;
  constexpr std::size_t kLongest = 64;
  if (cell.size() > kLongest) return std::nullopt;
  std::string with_e(cell);
  with_e[static_cast<std::size_t>(end - cell.data())] = 'e';
  const auto again = std::from_chars(with_e.data(), with_e.data() + with_e.size(), value);
  if (again.ec != std::errc() || again.ptr != with_e.data() + with_e.size()) return std::nullopt;
  return value;
}

std::optional<bool> ParseFlagWord(std::string_view cell) {
  constexpr std::size_t kLongest = 5;
  if (cell.size() > kLongest) return std::nullopt;
  const std::string word = Lower(cell);
  if (word == "true" || word == "t") return true;
  if (word == "false" || word == "f") return false;
  return std::nullopt;
}

CellKind KindOf(std::string_view cell) {
  if (IsMissing(cell)) return CellKind::kMissing;
  if (const auto number = ParseNumber(cell))
    return std::isfinite(*number) ? CellKind::kNumber : CellKind::kWord;
  return ParseFlagWord(cell) ? CellKind::kFlag : CellKind::kWord;
}

}  // namespace focalfleet
