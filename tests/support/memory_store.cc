#include "tests/support/memory_store.h"

#include <algorithm>
#include <tuple>
#include <utility>

#include "fleet/row_check.h"

namespace focalfleet::test {
namespace {

/// Returns the element of a list that is sorted by `key`; it is inserted where it is missing.
template <class Element, class Key>
Element& Slot(std::vector<Element>* list, const Element& like, Key key) {
  const auto at =
      std::lower_bound(list->begin(), list->end(), like,
                       [&](const Element& a, const Element& b) { return key(a) < key(b); });
  if (at != list->end() && key(*at) == key(like)) return *at;
  return *list->insert(at, like);
}

}  // namespace

Status MemoryStore::Commit(std::span<const Row> rows, std::size_t* refused) {
  if (refused != nullptr) *refused = rows.size();
  const auto refuse = [&](std::size_t k, const char* why) {
    if (refused != nullptr) *refused = k;
    return Fail(ErrorCode::kInvalid, Describe(rows[k]) + ": " + why);
  };
  for (std::size_t k = 0; k < rows.size(); ++k)
    if (const char* const flaw = Flaw(rows[k])) return refuse(k, flaw);
  std::set<std::uint64_t> entries = model_entries_;
  for (std::size_t k = 0; k < rows.size(); ++k)
    if (const auto* model = std::get_if<ModelRow>(&rows[k]);
        model != nullptr && !entries.insert(model->entry).second)
      return refuse(k, "its entry is there already");
  for (const bool ends : {false, true})
    for (const Row& row : rows)
      if (std::holds_alternative<IntentEndRow>(row) == ends)
        std::visit([this](const auto& what) { Keep(what); }, row);
  return {};
}

std::vector<RefusedRow> MemoryStore::CommitAllBut(std::uint64_t batch, std::vector<Row> rows) {
  std::vector<RefusedRow> aside;
  for (;;) {
    std::size_t refused = rows.size();
    const Status done = Commit(rows, &refused);
    if (done) return aside;
    const auto at = rows.begin() + static_cast<std::ptrdiff_t>(refused);
    aside.push_back({batch, batch, std::move(*at), done.error().text});
    rows.erase(at);
  }
}

const VectorRow* MemoryStore::Vector(SerialNumber serial) const {
  for (const VectorRow& row : fleet.vectors)
    if (row.serial == serial) return &row;
  return nullptr;
}

void MemoryStore::Keep(const VectorRow& row) {
  Slot(&fleet.vectors, row, [](const VectorRow& r) { return r.serial; }) = row;
}

void MemoryStore::Keep(const MeasurementRow& row) {
  fleet.next_exposure = std::max(fleet.next_exposure, row.exposure + 1);
}

void MemoryStore::Keep(const IntentRow& row) {
  begun.push_back(row);
  for (IntentRow& open : fleet.open_intents)
    if (open.serial == row.serial && open.move == row.move) {
      open = row;
      return;
    }
  fleet.open_intents.push_back(row);
}

void MemoryStore::Keep(const IntentEndRow& row) {
  ended.push_back(row);
  std::erase_if(fleet.open_intents, [&](const IntentRow& open) {
    return open.serial == row.serial && open.move == row.move;
  });
}

void MemoryStore::Keep(const BindingRow& row) {
  // A serial number is at one place only.
  for (StoredFleet::StoredUnit& unit : fleet.units)
    if (row.serial.value != 0 && unit.serial == row.serial && unit.unit != row.unit)
      unit.serial = {};
  Slot(&fleet.units, {.unit = row.unit, .serial = {}, .enabled = true, .reason = {}},
       [](const StoredFleet::StoredUnit& unit) { return unit.unit; })
      .serial = row.serial;
}

void MemoryStore::Keep(const EnableRow& row) {
  auto& unit = Slot(&fleet.units, {.unit = row.unit, .serial = {}, .enabled = true, .reason = {}},
                    [](const StoredFleet::StoredUnit& other) { return other.unit; });
  unit.enabled = row.enabled;
  unit.reason = row.reason;
}

void MemoryStore::Keep(const ParameterRow& row) {
  Slot(&fleet.parameters, row,
       [](const ParameterRow& r) { return std::tuple(r.serial, r.axis, r.parameter); }) = row;
}

void MemoryStore::Keep(const TuningRow& row) {
  Slot(&fleet.tunings, row, [](const TuningRow& r) { return std::tuple(r.serial, r.axis); }) = row;
}

void MemoryStore::Keep(const ConfigurationRow& row) {
  configurations.push_back(row);
  const auto by_id = [](const ConfigurationRow& r) { return r.id; };
  Slot(&fleet.configurations, row, by_id) = row;
  // The list keeps the configurations that never ended, and the newest.
  const std::uint64_t newest = fleet.configurations.back().id;
  std::erase_if(fleet.configurations,
                [&](const ConfigurationRow& r) { return IsOver(r.state) && r.id != newest; });
  fleet.next_configuration = std::max(fleet.next_configuration, row.id + 1);
}

void MemoryStore::Keep(const AlarmRow& row) {
  alarms.push_back(row);
  fleet.next_alarm = std::max(fleet.next_alarm, row.id + 1);
}

void MemoryStore::Keep(const OpenAlarmRow& row) {
  Slot(&fleet.open_alarms, row, [](const OpenAlarmRow& r) { return r.id; }) = row;
  std::erase_if(fleet.open_alarms,
                [](const OpenAlarmRow& r) { return r.state == OpenAlarmRow::State::kOver; });
}

void MemoryStore::Keep(const MuteRow& row) {
  Slot(&fleet.mutes, row, [](const MuteRow& r) { return std::string_view(Name(r.name)); }) = row;
}

void MemoryStore::Keep(const NextMoveRow& row) { fleet.next_move = row.next; }

void MemoryStore::Keep(const ModelRow& row) { model_entries_.insert(row.entry); }

}  // namespace focalfleet::test
