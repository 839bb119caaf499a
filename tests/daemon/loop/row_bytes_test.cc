#include "daemon/loop/row_bytes.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace focalfleet {
namespace {

TEST(RowBytes, CountTheRowAndEachOfItsTexts) {
  const std::string text(1000, 't');
  FibreCarrierReading carrier;
  carrier.verdict = text;
  const std::vector<Row> of_one_text = {
      EnableRow{.unit = UnitId{1}, .reason = text},
      ConfigurationRow{.source = text},
      AlarmRow{.text = text},
      AlarmEndRow{.reason = text},
      OpenAlarmRow{.text = text},
      OpenAlarmRow{.acknowledged_by = text},
      MuteRow{.reason = text},
      MuteRow{.by = text},
      MeasurementRow{.target_id = text},
      MeasurementRow{.target_id = {}, .carrier = carrier},
      ModelRow{.sha256 = {}, .text = std::make_shared<const std::string>(text)},
      ModelRow{.sha256 = {}, .campaign = text},
      AuditRow{.door = {}, .request = text},
      AuditRow{.door = {}, .process = AuditRow::Process{.program = text}},
      AuditRow{.door = {}, .reason = text}};
  for (const Row& row : of_one_text)
    EXPECT_EQ(BytesOf(row), sizeof(Row) + 1000) << "row of kind " << row.index();
  EXPECT_EQ(BytesOf(of_one_text), of_one_text.size() * (sizeof(Row) + 1000));
  EXPECT_EQ(BytesOf(Row{VectorRow{}}), sizeof(Row));
}

}  // namespace
}  // namespace focalfleet
