// The scenarios' store in memory must refuse what the real one refuses. Both get the same batches,
// drawn at random with flaws in them. They must answer alike, name the same row, and hold the same
// fleet.
#include "tests/support/memory_store.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "fleet/row_check.h"
#include "protocol/base/rng.h"
#include "tests/daemon/store/store_fixture.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

using test::Batch;
using test::MemoryStore;

constexpr WallTime kNow{Seconds(1'700'000'000).ns};

/// Rows about a few units, so that they meet; one in ten has a value that may be a flaw.
class RowSource {
 public:
  explicit RowSource(Rng rng) : rng_(rng) {}

  std::vector<Row> Batch() {
    std::vector<Row> rows;
    for (std::uint64_t k = 1 + rng_.Below(6); k > 0; --k) rows.push_back(Next());
    return rows;
  }

 private:
  Row Next() {
    switch (rng_.Below(15)) {
      case 0:
        return VectorRow{.serial = Serial(),
                         .knowledge = {Knowledge(), Knowledge()},
                         .offset = {Place(), Place()},
                         .subdivision = {Subdivision(), Subdivision()},
                         .move = Move(),
                         .origin = Code(kLastOrigin)};
      case 1:
        return MeasurementRow{
            .exposure = Id(),
            .configuration = Id(),
            .serial = Serial(),
            .unit = Unit(),
            .status = Code(kLastMeasurementStatus),
            .other = {},
            .x_mm = Real(),
            .y_mm = Real(),
            .covariance = {Real(), Real(), Real()},
            .place = {},
            .target_fp = PointFp{Real(), Real()},
            .error_um = Real(),
            .target_id = {},
            .delay_s = Real(),
            .source = Code(kLastMeasurementSource),
            .carrier = rng_.Below(2) == 0 ? std::nullopt : std::optional(FibreCarrier())};
      case 2:
        return IntentRow{.configuration = Id(),
                         .serial = Serial(),
                         .unit = Unit(),
                         .move = Move(),
                         .from = {Place(), Place()},
                         .to = {Place(), Place()},
                         .hull = {Hull(), Hull()}};
      case 3:
        return IntentEndRow{Serial(), Move(), Code(kLastIntentEnd)};
      case 4:
        return BindingRow{Unit(), Serial()};
      case 5:
        return EnableRow{Unit(), rng_.Below(2) == 0, "because"};
      case 6:
        return ParameterRow{Serial(), Code(Axis::kPhi), Code(kLastParameter), Place(),
                            Code(kLastOrigin)};
      case 7:
        return TuningRow{.serial = Serial(),
                         .axis = Code(Axis::kPhi),
                         .critical = static_cast<std::uint16_t>(rng_.Below(60)),
                         .repeat = static_cast<std::uint16_t>(30 + rng_.Below(60)),
                         .margin = Real(),
                         .load_uNm = Real(),
                         .v_bus_V = Real(),
                         .counter1 = Subdivision(),
                         .subdivision = Subdivision(),
                         .mode = Code(kLastMode),
                         .origin = Code(kLastOrigin)};
      case 8:
        return ConfigurationRow{.id = Id(),
                                .source = "c",
                                .state = Code(kLastConfigurationState),
                                .counts = {.arrived = 3, .stopped = 4, .unmeasured = 5},
                                .energy_J = Real()};
      case 9:
        return AlarmRow{Id(), Code(kLastSeverity), Unit(), {}, "a", Code(kLastAlarmName)};
      case 10:
        return NextMoveRow{Move()};
      case 11:
        return OpenAlarmRow{.id = Id(),
                            .name = Code(kLastAlarmName),
                            .severity = Code(kLastSeverity),
                            .unit = Unit(),
                            .text = "a",
                            .count = Odd() ? 0u : 2u,
                            .state = Code(OpenAlarmRow::State::kOver)};
      case 12:
        return MuteRow{.name = Code(kLastAlarmName), .until_unix_ns = Place(), .reason = "r"};
      case 13:
        return AuditRow{.door = "socket",
                        .name = "uid 1",
                        .role = "viewer",
                        .verb = std::string(Odd() ? 40 : 4, 'v')};
      default:
        return ModelRow{.entry = rng_.Below(40),
                        .sha256 = {},
                        .restores = rng_.Below(30),
                        .name = {},
                        .campaign = {},
                        .campaign_sha256 = {},
                        .text = {}};
    }
  }

  bool Odd() { return rng_.Below(40) == 0; }
  SerialNumber Serial() { return {Odd() ? 0u : static_cast<std::uint32_t>(1 + rng_.Below(5))}; }
  UnitId Unit() { return {static_cast<std::uint32_t>(rng_.Below(6))}; }
  MoveId Move() { return {static_cast<std::uint16_t>(rng_.Below(4))}; }
  std::uint64_t Id() {
    return Odd() ? std::numeric_limits<std::uint64_t>::max() - rng_.Below(2) : 1 + rng_.Below(20);
  }
  std::int32_t Place() {
    return Odd() ? std::numeric_limits<std::int32_t>::min()
                 : static_cast<std::int32_t>(rng_.Below(2000)) - 1000;
  }
  std::uint16_t Subdivision() { return Odd() ? std::uint16_t{1} : std::uint16_t{96}; }
  double Real() {
    constexpr double kOdd[] = {std::numeric_limits<double>::quiet_NaN(),
                               std::numeric_limits<double>::infinity(), -1};
    return Odd() ? kOdd[rng_.Below(3)] : 0.5 + static_cast<double>(rng_.Below(100));
  }
  template <class Enum>
  Enum Code(Enum last) {
    const auto count = static_cast<std::uint64_t>(last) + 1;
    return static_cast<Enum>(Odd() ? count : rng_.Below(count));
  }
  AxisKnowledge Knowledge() {
    const std::int32_t low = Place();
    return {Code(Witness::kMeasured), low, rng_.Below(4) == 0 ? Place() : low};
  }
  AxisKnowledge Hull() {
    const std::int32_t low = std::max(Place(), -1000);
    return {Witness::kInterval, low, Odd() ? low - 1 : low + 10};
  }
  FibreCarrierReading FibreCarrier() {
    FibreCarrierReading carrier{
        .used = 3, .solved = rng_.Below(2) == 0, .trusted = rng_.Below(4) == 0};
    carrier.angles_deg = {Real(), Real(), Odd() ? 400.0 : 1.0};
    carrier.covariance_deg2 = {Real(), Real(), Real(), Real(), Real(), Real()};
    return carrier;
  }

  Rng rng_;
};

/// Equality by which NaNs are equal.
StoredFleet Comparable(StoredFleet fleet) {
  for (ConfigurationRow& row : fleet.configurations)
    for (double* value : {&row.makespan_predicted_s, &row.makespan_s, &row.energy_J,
                          &row.peak_power_W, &row.start_skew_s, &row.start_skew_bound_s})
      if (std::isnan(*value)) *value = -7;
  return fleet;
}

void ExpectSameFleet(const StoredFleet& stored, const StoredFleet& in_memory) {
  EXPECT_EQ(stored.units, in_memory.units);
  EXPECT_EQ(stored.vectors, in_memory.vectors);
  EXPECT_EQ(stored.open_intents, in_memory.open_intents);
  EXPECT_EQ(stored.parameters, in_memory.parameters);
  EXPECT_EQ(stored.tunings, in_memory.tunings);
  EXPECT_EQ(stored.configurations, in_memory.configurations);
  EXPECT_EQ(stored.open_alarms, in_memory.open_alarms);
  EXPECT_EQ(stored.mutes, in_memory.mutes);
  EXPECT_EQ(stored.next_move, in_memory.next_move);
  EXPECT_EQ(stored.next_configuration, in_memory.next_configuration);
  EXPECT_EQ(stored.next_alarm, in_memory.next_alarm);
  EXPECT_EQ(stored.next_exposure, in_memory.next_exposure);
}

class MemoryStoreTest : public test::StoreTest {};

TEST_F(MemoryStoreTest, RefusesAndKeepsWhatTheStoreDoes) {
  auto store = OpenStore();
  MemoryStore memory;
  const std::uint64_t seed = test::TestSeed(1);
  RowSource source(Rng::Stream(seed, "rows"));
  int kept = 0;
  int refused = 0;
  for (int n = 0; n < 4000; ++n) {
    SCOPED_TRACE("seed " + std::to_string(seed) + ", batch " + std::to_string(n));
    const std::vector<Row> rows = source.Batch();
    std::size_t stored_row = 0;
    std::size_t memory_row = 0;
    const Status stored = store->Commit(rows, kNow, &stored_row);
    const Status in_memory = memory.Commit(rows, &memory_row);
    ASSERT_EQ(stored.has_value(), in_memory.has_value())
        << (stored ? in_memory.error().text : stored.error().text);
    ASSERT_EQ(stored_row, memory_row);
    (stored ? kept : refused) += 1;
    if (n % 50 != 0) continue;
    const auto loaded = store->Load();  // all kept rows can be read back
    ASSERT_TRUE(loaded) << loaded.error().text;
    ExpectSameFleet(Comparable(*loaded), Comparable(memory.fleet));
    if (HasFailure()) return;
  }
  EXPECT_GT(kept, 1000);
  EXPECT_GT(refused, 1000);
}

TEST_F(MemoryStoreTest, SetsAsideWhatTheStoreRefusesAlone) {
  auto store = OpenStore();
  MemoryStore memory;
  const std::uint64_t seed = test::TestSeed(2);
  RowSource source(Rng::Stream(seed, "rows"));
  for (std::uint64_t n = 1; n < 500; ++n) {
    SCOPED_TRACE("seed " + std::to_string(seed) + ", batch " + std::to_string(n));
    std::vector<Row> rows = source.Batch();
    const std::vector<RefusedRow> aside = memory.CommitAllBut(n, rows);
    std::size_t refused = 0;
    std::size_t count = 0;
    while (!store->Commit(rows, kNow, &refused)) {
      ASSERT_LT(refused, rows.size());
      ASSERT_LT(count, aside.size());
      EXPECT_EQ(Describe(aside[count++].row), Describe(rows[refused]));
      rows.erase(rows.begin() + static_cast<std::ptrdiff_t>(refused));
    }
    EXPECT_EQ(count, aside.size());
  }
  const auto loaded = store->Load();
  ASSERT_TRUE(loaded) << loaded.error().text;
  ExpectSameFleet(Comparable(*loaded), Comparable(memory.fleet));
}

}  // namespace
}  // namespace focalfleet
