// The step of the schema that keeps the audit. Rows are added at the end and never changed or
// deleted: triggers abort what would. A writer of the file can take triggers away, so each row also
// holds the hash of the row before it (audit_chain.h).
#pragma once

namespace focalfleet::store_internal {

inline constexpr const char* kAuditStep = R"sql(
CREATE TABLE audit(
  entry INTEGER PRIMARY KEY,      -- 1, 2, 3 and so on
  at_ns INTEGER NOT NULL,
  boot_id TEXT NOT NULL,          -- of the machine's start
  door TEXT NOT NULL,             -- socket, http
  name TEXT NOT NULL,             -- uid 1000, token NAME
  role TEXT NOT NULL,
  uid INTEGER,                    -- NULL: of HTTP
  gid INTEGER,
  pid INTEGER,
  program TEXT NOT NULL,
  address TEXT NOT NULL,          -- of HTTP
  verb TEXT NOT NULL,
  request TEXT NOT NULL,          -- as it came, its front
  request_bytes INTEGER NOT NULL,
  request_sha256 TEXT NOT NULL,   -- of all of it
  taken INTEGER NOT NULL,         -- 0: refused
  code TEXT NOT NULL,
  reason TEXT NOT NULL,
  configuration INTEGER NOT NULL, -- under way then; 0: none
  previous_sha256 TEXT NOT NULL,
  sha256 TEXT NOT NULL            -- of this row and the hash before it
) STRICT;
CREATE INDEX audit_by_time ON audit(at_ns);

CREATE TRIGGER audit_stays BEFORE UPDATE ON audit
  BEGIN SELECT RAISE(ABORT, 'an entry of the audit is not changed'); END;
CREATE TRIGGER audit_is_kept BEFORE DELETE ON audit
  BEGIN SELECT RAISE(ABORT, 'an entry of the audit is not deleted'); END;
CREATE TRIGGER audit_grows BEFORE INSERT ON audit
  WHEN NEW.entry IS NOT (SELECT coalesce(max(entry), 0) + 1 FROM audit)
  BEGIN SELECT RAISE(ABORT, 'an entry of the audit comes after the last one'); END;

-- A tail that is cut off together with its rows does not fit the count.
INSERT INTO meta(key, value, checksum)
  VALUES('audit_entries', 0, row_checksum('audit_entries', 0));
)sql";

}  // namespace focalfleet::store_internal
