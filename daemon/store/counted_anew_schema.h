// The step of the schema that keeps, for each serial number, the model that was in force when its
// count began anew last. A model that came earlier was measured on another count. The order is that
// of the rows in the store: a clock that steps back cannot turn it round.
#pragma once

namespace focalfleet::store_internal {

// Earlier versions had times alone.
inline constexpr const char* kCountedAnewStep = R"sql(
CREATE TABLE counted_anew(
  serial INTEGER PRIMARY KEY,
  model INTEGER NOT NULL        -- entry of the newest model_change then
) STRICT;

INSERT INTO counted_anew SELECT serial, max(model) FROM (
  SELECT serial, (SELECT max(entry) FROM model_change WHERE at_ns < ended_ns) AS model
    FROM intent WHERE end = 5
  UNION ALL SELECT serial,
    (SELECT max(entry) FROM model_change WHERE model_change.at_ns < axis_history.at_ns)
    FROM axis_history WHERE origin IN (3, 8)
  UNION ALL SELECT serial,
    (SELECT max(entry) FROM model_change WHERE model_change.at_ns < now.at_ns)
    FROM unit_history AS now WHERE serial <> 0 AND
    serial <> (SELECT before.serial FROM unit_history AS before WHERE
      before.unit_id = now.unit_id AND before.entry < now.entry AND before.serial <> 0
      ORDER BY before.entry DESC LIMIT 1)
  ) WHERE model IS NOT NULL GROUP BY serial;
)sql";

}  // namespace focalfleet::store_internal
