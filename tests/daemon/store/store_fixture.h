// A folder for a test's store, and batches whose content shows which of them the store holds.
#pragma once

#include <gtest/gtest.h>
#include <sqlite3.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "daemon/clock/wall_time.h"
#include "daemon/store/store.h"
#include "daemon/store/store_reader.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet::test {

class StoreTest : public ::testing::Test {
 protected:
  [[nodiscard]] std::string Path() const { return folder_ / "fleet.db"; }

  std::unique_ptr<Store> OpenStore(const char* vfs = nullptr) {
    auto store = Store::Open(Path(), {.vfs = vfs});
    EXPECT_TRUE(store) << (store ? "" : store.error().text);
    return store ? std::move(*store) : nullptr;
  }
  std::unique_ptr<StoreReader> OpenReader() {
    auto reader = StoreReader::Open(Path());
    EXPECT_TRUE(reader) << (reader ? "" : reader.error().text);
    return reader ? std::move(*reader) : nullptr;
  }
  /// SQL past the store, as an operator with the sqlite3 shell would run it.
  void Sql(const std::string& sql) {
    sqlite3* db = nullptr;
    ASSERT_EQ(sqlite3_open(Path().c_str(), &db), SQLITE_OK);
    char* error = nullptr;
    ASSERT_EQ(sqlite3_exec(db, sql.c_str(), nullptr, nullptr, &error), SQLITE_OK)
        << sql << ": " << (error == nullptr ? "" : error);
    sqlite3_close(db);
  }

  ScratchFolder folder_;
};

inline constexpr WallTime kEight{1'700'000'000'000'000'000};
inline constexpr WallTime kNine{1'700'003'600'000'000'000};

/// The error of an operation that should have failed. A success reads as an error that no test
/// expects.
template <class T>
Error ErrorOf(const Result<T>& result) {
  return result ? Error{static_cast<ErrorCode>(99), "success"} : result.error();
}

inline void ExpectDone(const Status& status) { EXPECT_TRUE(status) << status.error().text; }

inline VectorRow Vector(std::uint32_t serial, Witness witness, std::int32_t theta, std::int32_t phi,
                        std::uint16_t move = 1, Origin origin = Origin::kMove) {
  return {{serial}, Exactly(witness, Pose{theta, phi}), {}, {96, 96}, {move}, origin};
}

inline IntentRow Intent(std::uint32_t unit, std::uint32_t serial, std::uint16_t move, Pose from,
                        Pose to) {
  IntentRow row;
  row.configuration = 1;
  row.unit = {unit};
  row.serial = {serial};
  row.move = {move};
  row.from = from;
  row.to = to;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    row.hull[axis] = {Witness::kInterval, std::min(from[axis], to[axis]),
                      std::max(from[axis], to[axis])};
  }
  return row;
}

/// The tuning of the phi axis of serial number 7.
inline TuningRow Tuned(std::uint16_t critical, double margin) {
  return {.serial = {7},
          .axis = Axis::kPhi,
          .critical = critical,
          .repeat = 54,
          .margin = margin,
          .load_uNm = 4.07,
          .v_bus_V = 1.8,
          .counter1 = 500,
          .subdivision = 96,
          .mode = WaveMode::kSevenSegment};
}

/// Batch k holds k everywhere: in the vectors of all serials, in a parameter, in a tuning, in the
/// next move and in an alarm.
inline std::vector<Row> Batch(std::uint32_t k, std::uint32_t serials) {
  std::vector<Row> rows;
  for (std::uint32_t serial = 1; serial <= serials; ++serial) {
    const auto vectors = static_cast<std::int32_t>(k);
    rows.emplace_back(
        Vector(serial, Witness::kReported, vectors, -vectors, static_cast<std::uint16_t>(k)));
  }
  rows.emplace_back(ParameterRow{
      {1}, Axis::kPhi, Parameter::kRepeat, static_cast<std::int32_t>(k), Origin::kTuning});
  rows.emplace_back(TuningRow{.serial = {1},
                              .critical = 1,
                              .repeat = 1,
                              .margin = static_cast<double>(k),
                              .load_uNm = 1,
                              .v_bus_V = 1,
                              .counter1 = 1,
                              .subdivision = 6});
  rows.emplace_back(NextMoveRow{{static_cast<std::uint16_t>(k)}});
  rows.emplace_back(AlarmRow{k, Severity::kInfo, {}, {}, "batch " + std::to_string(k)});
  return rows;
}

/// The batch that a store holds; fails where it holds parts of two.
inline std::uint32_t BatchIn(const StoredFleet& fleet, std::uint32_t serials) {
  if (fleet.vectors.empty()) {
    EXPECT_EQ(fleet.next_alarm, 1u);
    EXPECT_TRUE(fleet.parameters.empty());
    EXPECT_TRUE(fleet.tunings.empty());
    return 0;
  }
  const auto k = static_cast<std::uint32_t>(fleet.next_alarm - 1);
  EXPECT_EQ(fleet.vectors.size(), serials);
  for (const VectorRow& row : fleet.vectors) {
    const auto vectors = static_cast<std::int32_t>(k);
    EXPECT_EQ(row.knowledge, Exactly(Witness::kReported, Pose{vectors, -vectors}));
    EXPECT_EQ(row.move.value, static_cast<std::uint16_t>(k));
  }
  EXPECT_EQ(fleet.parameters.size(), 1u);
  EXPECT_EQ(fleet.parameters.at(0).value, static_cast<std::int32_t>(k));
  EXPECT_EQ(fleet.tunings.size(), 1u);
  EXPECT_EQ(fleet.tunings.at(0).margin, k);
  EXPECT_EQ(fleet.next_move.value, static_cast<std::uint16_t>(k));
  return k;
}

}  // namespace focalfleet::test
