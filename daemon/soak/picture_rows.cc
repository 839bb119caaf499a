// Rows as the committed transaction leaves them on the disk: the second half of stored_picture.h.
#include <algorithm>
#include <string>
#include <utility>
#include <variant>

#include "daemon/soak/cell_text.h"
#include "daemon/soak/stored_picture.h"

namespace focalfleet::soak {
namespace {

template <class Id>
std::optional<std::uint32_t> NumberOf(const std::optional<Id>& id) {
  return id ? std::optional(id->value) : std::nullopt;
}

std::optional<std::string> NameOf(AlarmName name) {
  return name == AlarmName::kUnnamed ? std::nullopt : std::optional<std::string>(Name(name));
}

class Entry {
 public:
  Entry(Extent extent, StoredPicture* picture) : extent_(extent), picture_(*picture) {}

  void Take(const VectorRow& row) {
    picture_.places[row.serial.value] = PlaceOf(row);
    for (std::size_t axis = 0; axis < kAxisCount; ++axis)
      State("axis", RowText(row.serial.value, axis),
            RowText(row.subdivision[axis], row.move.value, row.origin, row.offset[axis]));
  }

  void Take(const IntentRow& row) {
    picture_.intents[row.serial.value] = {row.unit.value,
                                          row.move.value,
                                          {row.hull[0].low, row.hull[1].low},
                                          {row.hull[0].high, row.hull[1].high}};
    State("open_intent", RowText(row.serial.value, row.move.value),
          RowText(row.unit.value, row.configuration, row.from[0], row.from[1], row.to[0], row.to[1],
                  row.hull[0].low, row.hull[0].high, row.hull[1].low, row.hull[1].high));
  }

  void Take(const IntentEndRow& row) {
    const auto open = picture_.intents.find(row.serial.value);
    if (open != picture_.intents.end() && open->second.move == row.move.value)
      picture_.intents.erase(open);
    if (extent_ < Extent::kState) return;
    const bool was_open =
        picture_.others["open_intent"].erase(RowText(row.serial.value, row.move.value)) > 0;
    if (extent_ < Extent::kAll || !was_open) return;
    std::string& count =
        picture_.others["intent_end"][RowText(row.serial.value, row.move.value, row.end)];
    count = RowText(count.empty() ? 1 : std::stoi(count) + 1);
  }

  /// A serial number is bound to one place.
  void Take(const BindingRow& row) {
    for (auto& [unit, stored] : picture_.units)
      if (unit != row.unit.value && stored.serial == row.serial.value) stored.serial = 0;
    picture_.units[row.unit.value].serial = row.serial.value;
  }

  void Take(const EnableRow& row) {
    picture_.units[row.unit.value].enabled = row.enabled;
    picture_.units[row.unit.value].reason = row.reason;
  }

  void Take(const ParameterRow& row) {
    State("parameter", RowText(row.serial.value, row.axis, row.parameter),
          RowText(row.value, row.origin));
  }

  void Take(const TuningRow& row) {
    State("tuning", RowText(row.serial.value, row.axis),
          RowText(row.critical, row.repeat, row.margin, row.load_uNm, row.v_bus_V, row.counter1,
                  row.subdivision, row.mode, row.origin));
  }

  void Take(const MuteRow& row) {
    State("mute", RowText(std::string(Name(row.name))),
          RowText(row.until_unix_ns, row.since_unix_ns, row.reason, row.by));
  }

  void Take(const ModelRow& row) {
    if (row.text != nullptr && !row.sha256.empty() && extent_ >= Extent::kState)
      picture_.others["model"].try_emplace(RowText(row.sha256), RowText(*row.text));
    const auto sha256 = row.sha256.empty() ? std::nullopt : std::optional(row.sha256);
    const auto restores = row.restores == 0 ? std::nullopt : std::optional(row.restores);
    State("model_change", RowText(row.entry),
          RowText(sha256, restores, row.name, row.campaign, row.campaign_sha256, row.rms_before_um,
                  row.rms_after_um));
  }

  /// Numbers of moves begin again after the last one; the others only rise.
  void Take(const NextMoveRow& row) {
    State("next", RowText(std::string("next_move")), RowText(row.next.value));
  }

  void Take(const ConfigurationRow& row) {
    Raise("next_configuration", row.id + 1);
    const OutcomeCounts& units = row.counts;
    History(
        "configuration", RowText(row.id),
        RowText(row.source, row.state, units.targeted, units.arrived, units.refused, units.failed,
                units.stopped, units.unmeasured, row.makespan_predicted_s, row.makespan_s,
                row.energy_J, row.peak_power_W, row.start_skew_s, row.start_skew_bound_s));
  }

  void Take(const AlarmRow& row) {
    Raise("next_alarm", row.id + 1);
    History(
        "alarm", RowText(row.id),
        RowText(row.severity, NumberOf(row.unit), NumberOf(row.bus), row.text, NameOf(row.name)));
  }

  void Take(const OpenAlarmRow& row) {
    History("open_alarm", RowText(row.id),
            RowText(row.severity, NumberOf(row.unit), NumberOf(row.bus), row.text, NameOf(row.name),
                    row.count, row.state, row.first_unix_ns, row.last_unix_ns,
                    row.acknowledged_unix_ns, row.ended_unix_ns, row.acknowledged_by));
  }

  void Take(const MeasurementRow& row) {
    Raise("next_exposure", row.exposure + 1);
    const auto place = [&](std::size_t axis) {
      return row.place ? std::optional((*row.place)[axis]) : std::nullopt;
    };
    const auto target = [&](double PointFp::*x) {
      return row.target_fp ? std::optional((*row.target_fp).*x) : std::nullopt;
    };
    const auto& [xx, xy, yy] = row.covariance;
    History("measurement", RowText(row.exposure, row.unit.value),
            RowText(row.serial.value, row.configuration, row.status, NumberOf(row.other), row.x_mm,
                    row.y_mm, place(0), place(1), target(&PointFp::x_mm), target(&PointFp::y_mm),
                    row.error_um, xx, xy, yy, row.target_id, row.delay_s, row.source));
  }

  void Take(const AuditRow& row) {
    if (extent_ < Extent::kAll) return;
    StoredPicture::Table& audit = picture_.others["audit"];
    audit[RowText(audit.size() + 1)] =
        RowText(row.door, row.name, row.role, row.verb, row.request, row.request_bytes,
                row.request_sha256, row.taken, row.code, row.reason, row.configuration);
  }

  void Take(const AlarmEndRow&) {}  // the store has no row of it

 private:
  void State(const char* table, std::string key, std::string values) {
    if (extent_ >= Extent::kState) picture_.others[table][std::move(key)] = std::move(values);
  }
  void History(const char* table, std::string key, std::string values) {
    if (extent_ >= Extent::kAll) picture_.others[table][std::move(key)] = std::move(values);
  }
  void Raise(const char* key, std::uint64_t value) {
    if (extent_ < Extent::kState) return;
    std::string& next = picture_.others["next"][RowText(std::string(key))];
    if (next.empty() || std::stoull(next) < value) next = RowText(value);
  }

  Extent extent_;
  StoredPicture& picture_;
};

/// The first key whose value differs or is missing on one side.
template <class Map>
std::string FirstOf(const Map& acknowledged, const Map& read, const std::string& what) {
  for (const auto& [key, value] : acknowledged) {
    const auto found = read.find(key);
    if (found == read.end()) return fmt::format("{} {} is lost", what, key);
    if (!(found->second == value)) return fmt::format("{} {} is another one", what, key);
  }
  for (const auto& [key, value] : read)
    if (!acknowledged.contains(key))
      return fmt::format("{} {}, which nobody acknowledged, is there", what, key);
  return {};
}

}  // namespace

StoredPlace PlaceOf(const VectorRow& vector) {
  StoredPlace place;
  for (std::size_t axis = 0; axis < place.size(); ++axis)
    place[axis] = {static_cast<int>(vector.knowledge[axis].witness), vector.knowledge[axis].low,
                   vector.knowledge[axis].high};
  return place;
}

void Enter(std::span<const Row> rows, Extent extent, StoredPicture* picture) {
  Entry entry(extent, picture);
  const auto take = [&](bool ends) {
    for (const Row& row : rows)
      if (std::holds_alternative<IntentEndRow>(row) == ends)
        std::visit([&](const auto& each) { entry.Take(each); }, row);
  };
  take(false);
  take(true);
}

std::string FirstDifference(const StoredPicture& acknowledged, const StoredPicture& read) {
  std::string first = FirstOf(acknowledged.places, read.places, "the place of serial");
  if (first.empty()) first = FirstOf(acknowledged.intents, read.intents, "the intent of serial");
  if (first.empty()) first = FirstOf(acknowledged.units, read.units, "the binding of unit");
  const StoredPicture::Table none;
  for (const auto& [table, rows] : read.others) {
    const auto known = acknowledged.others.find(table);
    if (!first.empty()) break;
    first = FirstOf(known == acknowledged.others.end() ? none : known->second, rows,
                    "the row of " + table);
  }
  return first;
}

}  // namespace focalfleet::soak
