#include "fleet/files/column_units.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <iterator>
#include <vector>

#include "fleet/files/cell.h"

namespace focalfleet {
namespace {

enum class Kind : std::uint8_t {
  kLength,
  kAngle,
  kTime,
  kVolt,
  kAmpere,
  kWatt,
  kJoule,
  kPixel,
  kHeat
};

struct KnownUnit {
  std::string_view name;
  Kind kind;
  double factor;  // to the first unit of its kind
  double offset = 0;
};

constexpr double kDegPerRad = 57.295779513082320877;

constexpr KnownUnit kUnits[] = {
    {"mm", Kind::kLength, 1},
    {"m", Kind::kLength, 1e3},
    {"cm", Kind::kLength, 10},
    {"um", Kind::kLength, 1e-3},
    {"micron", Kind::kLength, 1e-3},
    {"microns", Kind::kLength, 1e-3},
    {"\xC2\xB5m", Kind::kLength, 1e-3},  // the sign for micro, and the Greek letter
    {"\xCE\xBCm", Kind::kLength, 1e-3},
    {"nm", Kind::kLength, 1e-6},
    {"deg", Kind::kAngle, 1},
    {"degree", Kind::kAngle, 1},
    {"degrees", Kind::kAngle, 1},
    {"\xC2\xB0", Kind::kAngle, 1},
    {"rad", Kind::kAngle, kDegPerRad},
    {"radian", Kind::kAngle, kDegPerRad},
    {"radians", Kind::kAngle, kDegPerRad},
    {"mrad", Kind::kAngle, kDegPerRad * 1e-3},
    {"arcmin", Kind::kAngle, 1.0 / 60},
    {"arcsec", Kind::kAngle, 1.0 / 3600},
    {"s", Kind::kTime, 1},
    {"sec", Kind::kTime, 1},
    {"second", Kind::kTime, 1},
    {"ms", Kind::kTime, 1e-3},
    {"us", Kind::kTime, 1e-6},
    {"ns", Kind::kTime, 1e-9},
    {"min", Kind::kTime, 60},
    {"h", Kind::kTime, 3600},
    {"hr", Kind::kTime, 3600},
    {"d", Kind::kTime, 86400},
    {"day", Kind::kTime, 86400},
    {"V", Kind::kVolt, 1},
    {"mV", Kind::kVolt, 1e-3},
    {"A", Kind::kAmpere, 1},
    {"mA", Kind::kAmpere, 1e-3},
    {"W", Kind::kWatt, 1},
    {"mW", Kind::kWatt, 1e-3},
    {"kW", Kind::kWatt, 1e3},
    {"J", Kind::kJoule, 1},
    {"mJ", Kind::kJoule, 1e-3},
    {"pix", Kind::kPixel, 1},
    {"pixel", Kind::kPixel, 1},
    {"px", Kind::kPixel, 1},
    {"C", Kind::kHeat, 1},
    {"deg_C", Kind::kHeat, 1},
    {"degC", Kind::kHeat, 1},
    {"Celsius", Kind::kHeat, 1},
    {"K", Kind::kHeat, 1, -273.15},
};

const KnownUnit* Known(std::string_view name) {
  const auto* found = std::ranges::find(kUnits, name, &KnownUnit::name);
  return found == std::end(kUnits) ? nullptr : found;
}

/// The unit in which a column's name ends; null: it ends in none.
const KnownUnit* UnitOfName(std::string_view column) {
  constexpr std::array<std::string_view, 9> kSuffixes = {"mm", "um", "deg", "s", "V",
                                                         "A",  "W",  "J",   "px"};
  const std::size_t mark = column.rfind('_');
  if (mark == std::string_view::npos) return nullptr;
  const std::string_view suffix = column.substr(mark + 1);
  if (suffix == "C") return Known("deg_C");
  return std::ranges::find(kSuffixes, suffix) == kSuffixes.end() ? nullptr : Known(suffix);
}

std::string_view Unquoted(std::string_view text) {
  text = Trimmed(text);
  const bool quoted = text.size() >= 2 && (text.front() == '\'' || text.front() == '"') &&
                      text.back() == text.front();
  return quoted ? text.substr(1, text.size() - 2) : text;
}

/// The parts of `{a: b, c: 'd, e'}` between the commas that no quote and no bracket encloses.
std::vector<std::string_view> PartsOf(std::string_view item) {
  std::vector<std::string_view> parts;
  std::size_t begin = 0;
  int depth = 0;
  char quote = 0;
  for (std::size_t at = 0; at < item.size(); ++at) {
    const char c = item[at];
    if (quote != 0) {
      if (c == quote) quote = 0;
    } else if (c == '\'' || c == '"') {
      quote = c;
    } else if (c == '{' || c == '[') {
      ++depth;
    } else if (c == '}' || c == ']') {
      --depth;
    } else if (c == ',' && depth == 0) {
      parts.push_back(item.substr(begin, at - begin));
      begin = at + 1;
    }
  }
  parts.push_back(item.substr(begin));
  return parts;
}

}  // namespace

UnitConversion ConversionOf(std::string_view column, std::string_view declared) {
  const KnownUnit* wanted = UnitOfName(column);
  declared = Trimmed(declared);
  if (wanted == nullptr || declared.empty() || declared == wanted->name) return {};
  const KnownUnit* given = Known(declared);
  if (given == nullptr || given->kind != wanted->kind)
    return {.problem = "its unit is " + Quoted(declared) + ", which cannot be converted to " +
                       std::string(wanted->name)};
  return {.factor = given->factor / wanted->factor,
          .offset = (given->offset - wanted->offset) / wanted->factor,
          .problem = ""};
}

void EcsvUnits::Take(std::string_view comment) {
  if (comment.starts_with(' ')) comment.remove_prefix(1);
  const std::string_view text = Trimmed(comment);
  const bool at_edge = !comment.empty() && comment.front() != ' ' && comment.front() != '-';
  if (at_edge) {
    EndItem();
    in_columns_ = text == "datatype:";
    return;
  }
  if (!in_columns_ || text.empty()) return;
  if (text.starts_with("- ")) {
    EndItem();
    item_ = text.substr(2);
    return;
  }
  // Another line of the item: of a block, where each holds a key of its own, or of a long text.
  const bool block = !item_.starts_with('{');
  item_ += (block ? "," : " ") + std::string(text);
}

void EcsvUnits::EndItem() {
  std::string_view item = Trimmed(item_);
  if (item.starts_with('{')) item.remove_prefix(1);
  if (item.ends_with('}')) item.remove_suffix(1);
  std::string name;
  std::string unit;
  for (const std::string_view part : PartsOf(item)) {
    const std::size_t colon = part.find(": ");
    if (colon == std::string_view::npos) continue;
    const std::string_view key = Trimmed(part.substr(0, colon));
    if (key == "name") name = Unquoted(part.substr(colon + 2));
    if (key == "unit") unit = Unquoted(part.substr(colon + 2));
  }
  if (!name.empty() && !unit.empty()) units_[name] = unit;
  item_.clear();
}

std::map<std::string, std::string> EcsvUnits::Units() {
  EndItem();
  return units_;
}

}  // namespace focalfleet
