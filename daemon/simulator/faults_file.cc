#include "daemon/simulator/faults_file.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <map>
#include <utility>

#include "daemon/control/id_ranges.h"
#include "fleet/files/csv.h"

namespace focalfleet::simulator {
namespace {

using namespace std::string_view_literals;
using sim::FaultKind;
using sim::FaultKindInfo;
using sim::PlannedFault;

constexpr double kSecondsMax = 365 * 86'400.0;
constexpr const char* kAll = "all";

std::string KindNames() {
  std::string names;
  for (std::size_t i = 0; i < sim::kFaultKindCount; ++i)
    names += (i > 0 ? ", " : "") + std::string(InfoOf(static_cast<FaultKind>(i)).name);
  return names;
}

class Reader {
 public:
  Reader(const CsvTable& table, const FaultsFor& fleet) : table_(table), fleet_(fleet) {
    for (const sim::UnitDescription& unit : fleet.units) {
      numbers_[0].push_back(unit.bus.value);
      numbers_[1].push_back(unit.id.value);
    }
    for (auto& numbers : numbers_) {
      std::ranges::sort(numbers);
      numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
    }
  }

  Result<std::vector<PlannedFault>> Read() {
    FOCALFLEET_TRY(table_.ReadRows([this](CsvRow& row) { ReadRow(&row); }));
    return std::move(plan_);
  }

 private:
  void ReadRow(CsvRow* row) {
    const auto kind = sim::FaultKindNamed(row->Text("fault"));
    if (!kind)
      return row->Reject("fault", "'" + row->Text("fault") + "' is none of " + KindNames());
    const FaultKindInfo& info = InfoOf(*kind);
    if (info.needs_bit_clock && !fleet_.bit_clock)
      return row->Reject("fault", "'" + std::string(info.name) +
                                      "' is of a simulated bus; with --bus the interface has "
                                      "faults of its own");
    PlannedFault fault{.kind = *kind};
    ReadTimes(row, &fault);
    ReadChanceAndValue(row, info, &fault);
    ReadWhere(row, info, fault);
  }

  static void ReadTimes(CsvRow* row, PlannedFault* fault) {
    const double from_s = row->NumberIfAny("from_s").value_or(0);
    const auto to_s = row->NumberIfAny("to_s");
    if (from_s < 0 || from_s > kSecondsMax)
      row->Reject("from_s", "is not within 0.." + NumberText(kSecondsMax));
    if (to_s && (*to_s <= from_s || *to_s > kSecondsMax))
      row->Reject("to_s", row->Text("to_s") + " is not behind from_s, or more than a year");
    if (row->error()) return;
    fault->from = Seconds(from_s);
    if (to_s) fault->to = Seconds(*to_s);
  }

  static void ReadChanceAndValue(CsvRow* row, const FaultKindInfo& info, PlannedFault* fault) {
    const bool per_bit = info.kind == FaultKind::kNoise;
    fault->chance = row->NumberIfAny("chance").value_or(1);
    if (!(fault->chance >= 0 && fault->chance <= 1) || (per_bit && !row->Has("chance")))
      row->Reject("chance", per_bit ? "is the bit error rate, 0..1" : "is not within 0..1");
    const auto value = row->NumberIfAny("value");
    if (info.value == nullptr) {
      if (value) row->Reject("value", std::string(info.name) + " has none");
      return;
    }
    if (!value && !info.value_otherwise)
      return row->Reject("value", std::string(info.name) + " needs one: " + info.value);
    fault->value = value ? *value : *info.value_otherwise;
    if (!(fault->value >= info.value_min && fault->value <= info.value_max))
      row->Reject("value", std::string(info.value) + " is not within " +
                               NumberText(info.value_min) + ".." + NumberText(info.value_max));
  }

  void ReadWhere(CsvRow* row, const FaultKindInfo& info, const PlannedFault& fault) {
    const char* column = info.of_unit ? "unit_id" : "bus_id";
    const char* other = info.of_unit ? "bus_id" : "unit_id";
    if (row->Has(other))
      return row->Reject(other, std::string(info.name) + " is of a " +
                                    (info.of_unit ? "unit" : "bus") + "; leave this empty");
    const std::vector<std::uint32_t>& known = numbers_[info.of_unit ? 1 : 0];
    std::vector<std::uint32_t> named = known;
    if (const std::string text = row->Text(column); text != kAll) {
      auto numbers = ParseRanges(text);
      if (!numbers)
        return row->Reject(column, "'" + text + "' is neither 'all' nor numbers such as 1,2,5-9");
      named = std::move(*numbers);
    }
    for (const std::uint32_t number : named) {
      if (!std::ranges::binary_search(known, number))
        return row->Reject(column, "there is no " + std::string(info.of_unit ? "unit " : "bus ") +
                                       std::to_string(number));
      PlannedFault one = fault;
      (info.of_unit ? one.unit.value : one.bus.value) = number;
      if (const int line = OverlappingLine(one, number); line != 0)
        return row->Reject(column, std::to_string(number) +
                                       " has this fault at that time already, "
                                       "by line " +
                                       std::to_string(line));
      if (row->error()) return;
      by_target_[{fault.kind, number}].push_back({one.from, one.to, row->line()});
      plan_.push_back(one);
    }
  }

  [[nodiscard]] int OverlappingLine(const PlannedFault& fault, std::uint32_t number) const {
    const auto found = by_target_.find({fault.kind, number});
    if (found == by_target_.end()) return 0;
    for (const Span& span : found->second)
      if (fault.from < span.to && span.from < fault.to) return span.line;
    return 0;
  }

  struct Span {
    DurationNs from;
    DurationNs to;
    int line;
  };
  const CsvTable& table_;
  const FaultsFor& fleet_;
  std::array<std::vector<std::uint32_t>, 2> numbers_;  // of buses, of units; ascending
  std::map<std::pair<FaultKind, std::uint32_t>, std::vector<Span>> by_target_;
  std::vector<PlannedFault> plan_;
};

}  // namespace

Result<std::vector<PlannedFault>> ReadFaults(std::string_view text, std::string file,
                                             const FaultsFor& fleet) {
  FOCALFLEET_TRY_ASSIGN(const CsvTable table, CsvTable::Parse(text, std::move(file)));
  static constexpr std::initializer_list<std::string_view> kKnown = {
      "fault"sv, "bus_id"sv, "unit_id"sv, "from_s"sv, "to_s"sv, "chance"sv, "value"sv};
  FOCALFLEET_TRY(table.Require(kKnown));
  for (std::size_t column = 0; column < table.columns().size(); ++column)
    if (table.HasName(column) && !std::ranges::count(kKnown, table.known_as(column)))
      return Fail(ErrorCode::kInvalid,
                  table.file() + ": no column is called '" + table.columns()[column] + "'");
  return Reader(table, fleet).Read();
}

}  // namespace focalfleet::simulator
