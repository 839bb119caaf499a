#include "daemon/store/schema.h"

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <string_view>

#include "daemon/store/audit_schema.h"
#include "daemon/store/counted_anew_schema.h"

namespace focalfleet::store_internal {
namespace {

// Codes are the enumerators of fleet/records.h and fleet/knowledge.h; the views spell them out for
// people. Positions are vectors from the axis' zero; turns * subdivision + vector is the unit's
// count, which is the position less the axis' offset.
constexpr const char* kVersion1 = R"sql(
CREATE TABLE meta(
  key TEXT PRIMARY KEY,
  value INTEGER NOT NULL
) STRICT, WITHOUT ROWID;

CREATE TABLE unit(
  unit_id INTEGER PRIMARY KEY,
  serial INTEGER NOT NULL,      -- 0: nothing bound yet
  enabled INTEGER NOT NULL,
  reason TEXT NOT NULL,
  at_ns INTEGER NOT NULL
) STRICT;
CREATE UNIQUE INDEX unit_serial ON unit(serial) WHERE serial <> 0;

CREATE TABLE unit_history(
  entry INTEGER PRIMARY KEY,
  unit_id INTEGER NOT NULL,
  serial INTEGER NOT NULL,
  enabled INTEGER NOT NULL,
  reason TEXT NOT NULL,
  at_ns INTEGER NOT NULL
) STRICT;
CREATE INDEX unit_history_by_unit ON unit_history(unit_id);

CREATE TABLE axis_state(
  serial INTEGER NOT NULL,
  axis INTEGER NOT NULL,
  witness INTEGER NOT NULL,
  low INTEGER NOT NULL,
  high INTEGER NOT NULL,
  vector INTEGER,               -- 0..subdivision-1, where the axis stands at one place
  turns INTEGER,
  subdivision INTEGER NOT NULL,
  move INTEGER NOT NULL,
  origin INTEGER NOT NULL,
  at_ns INTEGER NOT NULL,
  PRIMARY KEY(serial, axis)
) STRICT, WITHOUT ROWID;

-- Vectors that changed otherwise than by a motion; motions have their history in intent.
CREATE TABLE axis_history(
  entry INTEGER PRIMARY KEY,
  serial INTEGER NOT NULL,
  axis INTEGER NOT NULL,
  witness INTEGER NOT NULL,
  low INTEGER NOT NULL,
  high INTEGER NOT NULL,
  subdivision INTEGER NOT NULL,
  origin INTEGER NOT NULL,
  at_ns INTEGER NOT NULL
) STRICT;

CREATE TABLE intent(
  entry INTEGER PRIMARY KEY,
  configuration INTEGER NOT NULL,
  unit_id INTEGER NOT NULL,
  serial INTEGER NOT NULL,
  move INTEGER NOT NULL,
  theta_from INTEGER NOT NULL,
  phi_from INTEGER NOT NULL,
  theta_to INTEGER NOT NULL,
  phi_to INTEGER NOT NULL,
  theta_low INTEGER NOT NULL,   -- all that it may pass
  theta_high INTEGER NOT NULL,
  phi_low INTEGER NOT NULL,
  phi_high INTEGER NOT NULL,
  began_ns INTEGER NOT NULL,
  ended_ns INTEGER,
  end INTEGER,                  -- NULL: open
  theta_end_witness INTEGER,
  theta_end_low INTEGER,
  theta_end_high INTEGER,
  phi_end_witness INTEGER,
  phi_end_low INTEGER,
  phi_end_high INTEGER
) STRICT;
CREATE UNIQUE INDEX intent_open ON intent(serial, move) WHERE end IS NULL;
CREATE INDEX intent_by_unit ON intent(unit_id);

CREATE TABLE parameter(
  serial INTEGER NOT NULL,
  axis INTEGER NOT NULL,
  parameter INTEGER NOT NULL,
  value INTEGER NOT NULL,
  origin INTEGER NOT NULL,
  at_ns INTEGER NOT NULL,
  PRIMARY KEY(serial, axis, parameter)
) STRICT, WITHOUT ROWID;

CREATE TABLE parameter_history(
  entry INTEGER PRIMARY KEY,
  serial INTEGER NOT NULL,
  axis INTEGER NOT NULL,
  parameter INTEGER NOT NULL,
  value INTEGER NOT NULL,
  origin INTEGER NOT NULL,
  at_ns INTEGER NOT NULL
) STRICT;
CREATE INDEX parameter_history_by_serial ON parameter_history(serial);

CREATE TABLE configuration(
  id INTEGER PRIMARY KEY,
  source TEXT NOT NULL,
  state INTEGER NOT NULL,
  targeted INTEGER NOT NULL,
  arrived INTEGER NOT NULL,
  refused INTEGER NOT NULL,
  failed INTEGER NOT NULL,
  makespan_predicted_s REAL,    -- NULL: not a number
  makespan_s REAL,
  energy_J REAL,
  peak_power_W REAL,
  began_ns INTEGER NOT NULL,
  changed_ns INTEGER NOT NULL
) STRICT;

CREATE TABLE alarm(
  id INTEGER PRIMARY KEY,
  severity INTEGER NOT NULL,
  unit_id INTEGER,
  bus_id INTEGER,
  text TEXT NOT NULL,
  at_ns INTEGER NOT NULL
) STRICT;

CREATE VIEW stand AS SELECT
  unit.unit_id, axis_state.serial,
  CASE axis WHEN 0 THEN 'theta' ELSE 'phi' END AS axis,
  CASE witness WHEN 0 THEN 'unknown' WHEN 1 THEN 'interval' WHEN 2 THEN 'predicted'
    WHEN 3 THEN 'reported' ELSE 'measured' END AS witness,
  low, high, vector, turns, subdivision, move,
  datetime(axis_state.at_ns / 1000000000, 'unixepoch') AS at_utc
  FROM axis_state LEFT JOIN unit ON unit.serial = axis_state.serial;

CREATE VIEW motion AS SELECT
  unit_id, serial, configuration, move, theta_from, theta_to, phi_from, phi_to,
  datetime(began_ns / 1000000000, 'unixepoch') AS began_utc,
  datetime(ended_ns / 1000000000, 'unixepoch') AS ended_utc,
  CASE end WHEN 0 THEN 'arrived' WHEN 1 THEN 'stopped' WHEN 2 THEN 'fault'
    WHEN 3 THEN 'never_began' WHEN 4 THEN 'interrupted' WHEN 5 THEN 'homed' ELSE 'open' END AS end
  FROM intent;

PRAGMA application_id = 1179012180;
)sql";
static_assert(kApplicationId == 1179012180);

// Results of tunings; earlier versions kept only the parameters that tunings set.
constexpr const char* kVersion2 = R"sql(
CREATE TABLE tuning(
  serial INTEGER NOT NULL,
  axis INTEGER NOT NULL,
  critical INTEGER NOT NULL,    -- least n that starts the load from rest
  repeat INTEGER NOT NULL,      -- n that was chosen
  margin REAL NOT NULL,         -- share by which the load may grow until that n is critical
  load_uNm REAL NOT NULL,
  v_bus_V REAL NOT NULL,
  counter1 INTEGER NOT NULL,
  subdivision INTEGER NOT NULL,
  mode INTEGER NOT NULL,
  origin INTEGER NOT NULL,
  at_ns INTEGER NOT NULL,
  PRIMARY KEY(serial, axis)
) STRICT, WITHOUT ROWID;

-- Every tuning, the present one too.
CREATE TABLE tuning_history(
  entry INTEGER PRIMARY KEY,
  serial INTEGER NOT NULL,
  axis INTEGER NOT NULL,
  critical INTEGER NOT NULL,
  repeat INTEGER NOT NULL,
  margin REAL NOT NULL,
  load_uNm REAL NOT NULL,
  v_bus_V REAL NOT NULL,
  counter1 INTEGER NOT NULL,
  subdivision INTEGER NOT NULL,
  mode INTEGER NOT NULL,
  origin INTEGER NOT NULL,
  at_ns INTEGER NOT NULL
) STRICT;
CREATE INDEX tuning_history_by_serial ON tuning_history(serial);

CREATE VIEW tuned AS SELECT
  unit.unit_id, tuning.serial,
  CASE axis WHEN 0 THEN 'theta' ELSE 'phi' END AS axis,
  critical, repeat, margin, load_uNm, v_bus_V, counter1, subdivision,
  CASE mode WHEN 0 THEN 'asymmetric' WHEN 1 THEN 'five_segment' ELSE 'seven_segment' END AS mode,
  CASE origin WHEN 0 THEN 'factory' WHEN 1 THEN 'tuning' WHEN 2 THEN 'campaign'
    WHEN 3 THEN 'operator' WHEN 4 THEN 'move' ELSE 'homing' END AS origin,
  datetime(tuning.at_ns / 1000000000, 'unixepoch') AS at_utc
  FROM tuning LEFT JOIN unit ON unit.serial = tuning.serial;
)sql";

// Start skew: how far apart the units of a configuration began.
constexpr const char* kVersion3 = R"sql(
ALTER TABLE configuration ADD COLUMN start_skew_s REAL;        -- NULL: not known
ALTER TABLE configuration ADD COLUMN start_skew_bound_s REAL;  -- the true skew is within +- of it
)sql";

// Measurements of a camera, and the offset of an axis' place from its count of vectors.
constexpr const char* kVersion4 = R"sql(
ALTER TABLE axis_state ADD COLUMN offset INTEGER NOT NULL DEFAULT 0;

CREATE TABLE measurement(
  exposure INTEGER NOT NULL,
  unit_id INTEGER NOT NULL,
  serial INTEGER NOT NULL,
  configuration INTEGER NOT NULL,
  status INTEGER NOT NULL,
  other INTEGER,                -- unit_id of the one that it is confused with
  x_mm REAL NOT NULL,
  y_mm REAL NOT NULL,
  sigma_um REAL NOT NULL,
  theta INTEGER,                -- vectors; NULL: the unit was put nowhere
  phi INTEGER,
  target_x_mm REAL,             -- NULL: it had none
  target_y_mm REAL,
  error_um REAL,                -- from its target
  at_ns INTEGER NOT NULL,
  PRIMARY KEY(exposure, unit_id)
) STRICT, WITHOUT ROWID;

CREATE VIEW measured AS SELECT
  exposure, unit_id, configuration,
  CASE status WHEN 0 THEN 'measured' WHEN 1 THEN 'did_not_move' WHEN 2 THEN 'swapped'
    WHEN 3 THEN 'strayed' WHEN 4 THEN 'swap_suspected' WHEN 5 THEN 'blended'
    WHEN 6 THEN 'outside_patrol' WHEN 7 THEN 'ambiguous' ELSE 'missing' END AS status,
  x_mm, y_mm, sigma_um, target_x_mm, target_y_mm, error_um,
  datetime(at_ns / 1000000000, 'unixepoch') AS at_utc
  FROM measurement;
)sql";

// Covariance of a measurement, name of the target, delay after the motion.
constexpr const char* kVersion5 = R"sql(
ALTER TABLE measurement ADD COLUMN var_x_mm2 REAL NOT NULL DEFAULT 0;
ALTER TABLE measurement ADD COLUMN cov_xy_mm2 REAL NOT NULL DEFAULT 0;
ALTER TABLE measurement ADD COLUMN var_y_mm2 REAL NOT NULL DEFAULT 0;
ALTER TABLE measurement ADD COLUMN target_id TEXT NOT NULL DEFAULT '';
ALTER TABLE measurement ADD COLUMN delay_s REAL;  -- end of motion to exposure; NULL: not known
UPDATE measurement
  SET var_x_mm2 = sigma_um * sigma_um * 1e-6, var_y_mm2 = sigma_um * sigma_um * 1e-6;

DROP VIEW measured;
CREATE VIEW measured AS SELECT
  exposure, unit_id, configuration, target_id,
  CASE status WHEN 0 THEN 'measured' WHEN 1 THEN 'did_not_move' WHEN 2 THEN 'swapped'
    WHEN 3 THEN 'strayed' WHEN 4 THEN 'swap_suspected' WHEN 5 THEN 'blended'
    WHEN 6 THEN 'outside_patrol' WHEN 7 THEN 'ambiguous' ELSE 'missing' END AS status,
  x_mm, y_mm, sigma_um, var_x_mm2, cov_xy_mm2, var_y_mm2, target_x_mm, target_y_mm, error_um,
  delay_s, datetime(at_ns / 1000000000, 'unixepoch') AS at_utc
  FROM measurement;
)sql";

// Models that blind commands went through, and the time of each change.
constexpr const char* kVersion6 = R"sql(
CREATE TABLE model(
  sha256 TEXT PRIMARY KEY,      -- of the text, in hex
  text TEXT NOT NULL,           -- model.toml
  at_ns INTEGER NOT NULL
) STRICT;

CREATE TABLE model_change(
  entry INTEGER PRIMARY KEY,    -- the last is what holds
  sha256 TEXT,                  -- NULL: from here on none
  restores INTEGER,             -- entry that it goes back to; NULL: none
  name TEXT NOT NULL,
  campaign TEXT NOT NULL,
  campaign_sha256 TEXT NOT NULL,
  rms_before_um REAL,           -- NULL: not known
  rms_after_um REAL,
  at_ns INTEGER NOT NULL
) STRICT;
)sql";

// Units that measure themselves: source of a measurement, and readings of the sensors at a joint.
constexpr const char* kVersion7 = R"sql(
ALTER TABLE measurement ADD COLUMN source INTEGER NOT NULL DEFAULT 0;  -- 0 camera, 1 own sensors

CREATE TABLE orientation(
  exposure INTEGER NOT NULL,
  unit_id INTEGER NOT NULL,
  serial INTEGER NOT NULL,
  trusted INTEGER NOT NULL,     -- 1: it could be measured by them
  verdict TEXT NOT NULL,        -- ok, or which sensors lie, or cannot tell
  used INTEGER NOT NULL,        -- bit k: sensor k took part
  alpha_deg REAL,               -- NULL: there is no orientation
  beta_deg REAL,
  gamma_deg REAL,
  cov_aa_deg2 REAL,
  cov_ab_deg2 REAL,
  cov_ag_deg2 REAL,
  cov_bb_deg2 REAL,
  cov_bg_deg2 REAL,
  cov_gg_deg2 REAL,
  at_ns INTEGER NOT NULL,
  PRIMARY KEY(exposure, unit_id)
) STRICT, WITHOUT ROWID;

DROP VIEW measured;
CREATE VIEW measured AS SELECT
  exposure, unit_id, configuration, target_id,
  CASE status WHEN 0 THEN 'measured' WHEN 1 THEN 'did_not_move' WHEN 2 THEN 'swapped'
    WHEN 3 THEN 'strayed' WHEN 4 THEN 'swap_suspected' WHEN 5 THEN 'blended'
    WHEN 6 THEN 'outside_patrol' WHEN 7 THEN 'ambiguous' WHEN 8 THEN 'missing'
    WHEN 9 THEN 'sensors_doubted' ELSE 'too_coarse' END AS status,
  CASE source WHEN 0 THEN 'camera' ELSE 'hall_sensors' END AS source,
  x_mm, y_mm, sigma_um, var_x_mm2, cov_xy_mm2, var_y_mm2, target_x_mm, target_y_mm, error_um,
  delay_s, orientation.verdict AS sensors, alpha_deg, beta_deg, gamma_deg,
  datetime(measurement.at_ns / 1000000000, 'unixepoch') AS at_utc
  FROM measurement LEFT JOIN orientation USING (exposure, unit_id);
)sql";

// Targets that a stop cut short, and arrivals that no measurement confirmed, are counted apart from
// failures.
constexpr const char* kVersion8 = R"sql(
ALTER TABLE configuration ADD COLUMN stopped INTEGER NOT NULL DEFAULT 0;
ALTER TABLE configuration ADD COLUMN unmeasured INTEGER NOT NULL DEFAULT 0;
)sql";

// Alarms have names, and stay open until their condition ends or somebody acknowledges them.
constexpr const char* kVersion9 = R"sql(
ALTER TABLE alarm ADD COLUMN name TEXT;  -- NULL: raised before alarms had names
CREATE INDEX alarm_by_time ON alarm(at_ns);

CREATE TABLE open_alarm(
  id INTEGER PRIMARY KEY,       -- of the alarm that opened it
  name TEXT,
  severity INTEGER NOT NULL,
  unit_id INTEGER,
  bus_id INTEGER,
  text TEXT NOT NULL,           -- of the newest
  count INTEGER NOT NULL,       -- equal alarms since the first, itself included
  state INTEGER NOT NULL,       -- 0 open, 1 acknowledged while the condition lasts, 2 over
  first_ns INTEGER NOT NULL,
  last_ns INTEGER NOT NULL,
  acknowledged_ns INTEGER NOT NULL,  -- 0: by nobody
  ended_ns INTEGER NOT NULL,    -- 0: the condition lasts, or is none
  acknowledged_by TEXT NOT NULL
) STRICT;
CREATE INDEX open_alarm_lasting ON open_alarm(id) WHERE state < 2;
CREATE INDEX open_alarm_by_time ON open_alarm(last_ns) WHERE state = 2;

CREATE TABLE mute(
  name TEXT PRIMARY KEY,
  until_ns INTEGER NOT NULL,    -- 0: no longer
  since_ns INTEGER NOT NULL,
  reason TEXT NOT NULL,
  by TEXT NOT NULL
) STRICT, WITHOUT ROWID;
)sql";

// Checksums of the rows that decide where a unit stands, whether it moves and how. A checksum
// covers the columns named here; those of an intent do not change when it ends.
constexpr const char* kVersion10 = R"sql(
ALTER TABLE axis_state ADD COLUMN checksum INTEGER;
UPDATE axis_state SET checksum = row_checksum(serial, axis, witness, low, high, vector, turns,
  subdivision, move, origin, at_ns, offset);
ALTER TABLE unit ADD COLUMN checksum INTEGER;
UPDATE unit SET checksum = row_checksum(unit_id, serial, enabled, reason, at_ns);
ALTER TABLE parameter ADD COLUMN checksum INTEGER;
UPDATE parameter SET checksum = row_checksum(serial, axis, parameter, value, origin, at_ns);
ALTER TABLE tuning ADD COLUMN checksum INTEGER;
UPDATE tuning SET checksum = row_checksum(serial, axis, critical, repeat, margin, load_uNm, v_bus_V,
  counter1, subdivision, mode, origin, at_ns);
ALTER TABLE meta ADD COLUMN checksum INTEGER;
UPDATE meta SET checksum = row_checksum(key, value);
ALTER TABLE intent ADD COLUMN checksum INTEGER;  -- NULL: it ended before rows had checksums
UPDATE intent SET checksum = row_checksum(configuration, unit_id, serial, move, theta_from,
  phi_from, theta_to, phi_to, theta_low, theta_high, phi_low, phi_high) WHERE end IS NULL;
-- Pruning asks for each homing whether its unit has a later one.
CREATE INDEX intent_homed ON intent(unit_id, entry) WHERE end = 5;
-- Checksums guard what a row holds, not that it is there; a start is not to read all motions.
INSERT INTO meta(key, value, checksum) SELECT 'open_intents', count(*),
  row_checksum('open_intents', count(*)) FROM intent WHERE end IS NULL;
)sql";

constexpr const char* kMigrations[] = {kVersion1, kVersion2,  kVersion3,  kVersion4,
                                       kVersion5, kVersion6,  kVersion7,  kVersion8,
                                       kVersion9, kVersion10, kAuditStep, kCountedAnewStep};

constexpr std::size_t kHeaderBytes = 72;
constexpr std::size_t kUserVersionAt = 60;
constexpr std::size_t kApplicationIdAt = 68;

std::int32_t BigEndian(const unsigned char* bytes) {
  const std::uint32_t value = (std::uint32_t{bytes[0]} << 24) | (std::uint32_t{bytes[1]} << 16) |
                              (std::uint32_t{bytes[2]} << 8) | std::uint32_t{bytes[3]};
  return static_cast<std::int32_t>(value);
}

tl::unexpected<Error> NotOurs(const std::string& path) {
  return Fail(ErrorCode::kInvalid, "store " + path + ": not a store of this program");
}

Status CheckVersion(const std::string& path, std::int32_t application_id, std::int32_t version,
                    std::int32_t version_max) {
  // Both are 0 where nothing was written yet, or the first step was interrupted.
  const bool blank = application_id == 0 && version == 0;
  if ((application_id != kApplicationId && !blank) || version < 0) return NotOurs(path);
  if (version > version_max) {
    return Fail(ErrorCode::kNewer, "store " + path + " has version " + std::to_string(version) +
                                       ", this program knows up to " + std::to_string(version_max) +
                                       ": it was left as it is");
  }
  return {};
}

}  // namespace

std::span<const char* const> Migrations() { return kMigrations; }

Status InspectHeader(const std::string& path, std::int32_t version_max) {
  const int descriptor = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) {
    if (errno == ENOENT) return {};
    return Fail(ErrorCode::kUnavailable, "store " + path + ": " + std::strerror(errno));
  }
  std::array<unsigned char, kHeaderBytes> header{};
  const ssize_t length = pread(descriptor, header.data(), header.size(), 0);
  const int error = errno;
  close(descriptor);
  if (length < 0)
    return Fail(ErrorCode::kUnavailable, "store " + path + ": " + std::strerror(error));
  if (length == 0) return {};
  constexpr std::string_view kMagic("SQLite format 3\0", 16);
  if (static_cast<std::size_t>(length) < kHeaderBytes ||
      std::memcmp(header.data(), kMagic.data(), kMagic.size()) != 0) {
    return NotOurs(path);
  }
  return CheckVersion(path, BigEndian(&header[kApplicationIdAt]),
                      BigEndian(&header[kUserVersionAt]), version_max);
}

Result<std::int32_t> InspectSchema(Connection& connection, std::int32_t version_max) {
  FOCALFLEET_TRY_ASSIGN(const std::int64_t application_id,
                        connection.Integer("PRAGMA application_id"));
  FOCALFLEET_TRY_ASSIGN(const std::int64_t version, connection.Integer("PRAGMA user_version"));
  FOCALFLEET_TRY(CheckVersion(connection.path(), static_cast<std::int32_t>(application_id),
                              static_cast<std::int32_t>(version), version_max));
  if (version == 0) {
    FOCALFLEET_TRY_ASSIGN(const std::int64_t objects,
                          connection.Integer("SELECT count(*) FROM sqlite_schema"));
    if (objects != 0) return NotOurs(connection.path());
  }
  return static_cast<std::int32_t>(version);
}

Status Migrate(Connection& connection, std::int32_t version, std::span<const char* const> steps) {
  for (std::size_t next = static_cast<std::size_t>(version); next < steps.size(); ++next) {
    FOCALFLEET_TRY(connection.Execute("BEGIN IMMEDIATE"));
    const std::string raise = "PRAGMA user_version = " + std::to_string(next + 1);
    Status done = connection.Execute(steps[next]);
    if (done) done = connection.Execute(raise.c_str());
    if (done) done = connection.Execute("COMMIT");
    if (!done) {
      connection.Rollback();
      done.error().text += ", while carrying the store over to version " + std::to_string(next + 1);
      return done;
    }
  }
  return {};
}

}  // namespace focalfleet::store_internal
