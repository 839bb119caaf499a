#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "daemon/store/audit_chain.h"
#include "daemon/store/sqlite.h"
#include "tests/daemon/store/store_fixture.h"

namespace focalfleet {
namespace {

using test::ErrorOf;
using test::ExpectDone;
using test::kEight;
using test::kNine;
using ::testing::HasSubstr;
using ::testing::SizeIs;

AuditRow Of(const std::string& name, const std::string& verb, bool taken = true) {
  return {.door = "socket",
          .name = name,
          .role = "operator",
          .process = AuditRow::Process{.pid = 7, .uid = 1000, .gid = 100, .program = "focalfleet"},
          .boot_id = "boot",
          .verb = verb,
          .request = "{\"verb\":\"" + verb + "\"}",
          .request_sha256 = std::string(64, 'a'),
          .request_bytes = 20,
          .taken = taken,
          .configuration = 3};
}

class AuditTest : public test::StoreTest {
 protected:
  void Fill(int entries = 5) {
    const auto store = OpenStore();
    for (int n = 0; n < entries; ++n)
      ExpectDone(store->Commit(std::vector<Row>{Of("uid " + std::to_string(n % 2), "apply")},
                               {kEight.ns + n}));
  }
  AuditVerdict Check(const std::vector<AuditHead>& heads = {}) {
    const auto verdict = OpenReader()->CheckAudit(heads);
    EXPECT_TRUE(verdict) << verdict.error().text;
    return verdict ? *verdict : AuditVerdict{};
  }
  /// SQL of somebody who may write the file: the triggers are no obstacle to him.
  void Forge(const std::string& sql) {
    Sql("DROP TRIGGER audit_stays; DROP TRIGGER audit_is_kept; DROP TRIGGER audit_grows; " + sql);
  }
  std::string Flaw() { return Check().flaw.value_or(""); }
};

TEST_F(AuditTest, AnEntryComesBackAsItWasGiven) {
  AuditRow refused = Of("uid 2", "adopt", false);
  refused.code = "refused";
  refused.reason = "may not";
  AuditRow token = Of("token page", "stop");
  token.door = "http";
  token.process.reset();
  token.address = "::1";
  ExpectDone(OpenStore()->Commit(std::vector<Row>{refused, token}, kEight));
  const auto entries = OpenReader()->Audit({});
  ASSERT_TRUE(entries);
  ASSERT_THAT(*entries, SizeIs(2));
  EXPECT_EQ((*entries)[1].row, refused);
  EXPECT_EQ((*entries)[0].row, token);
  EXPECT_EQ((*entries)[0].entry, 2u);
  EXPECT_EQ((*entries)[0].at, kEight);
  EXPECT_EQ((*entries)[0].previous_sha256, (*entries)[1].sha256);
  EXPECT_EQ((*entries)[1].previous_sha256, BeforeAudit().sha256);
}

TEST_F(AuditTest, IsFilteredByCallerVerbAndTime) {
  Fill();
  ExpectDone(OpenStore()->Commit(std::vector<Row>{Of("uid 0", "stop")}, kNine));
  const auto count = [&](const AuditFilter& filter) { return OpenReader()->Audit(filter)->size(); };
  EXPECT_EQ(count({}), 6u);
  EXPECT_EQ(count({.name = "uid 0"}), 4u);
  EXPECT_EQ(count({.verb = "stop"}), 1u);
  EXPECT_EQ(count({.name = "uid 1", .verb = "stop"}), 0u);
  EXPECT_EQ(count({.period = {.since = kNine}}), 1u);
  EXPECT_EQ(count({.limit = 2}), 2u);
}

TEST_F(AuditTest, IsInTheTransactionOfItsRows) {
  const auto store = OpenStore();
  const AlarmRow impossible{.id = ~std::uint64_t{0}, .text = "x"};
  EXPECT_FALSE(store->Commit(std::vector<Row>{Of("uid 1", "apply"), impossible}, kEight));
  EXPECT_THAT(*OpenReader()->Audit({}), SizeIs(0));
  ExpectDone(store->Commit(std::vector<Row>{Of("uid 1", "apply")}, kEight));
  EXPECT_EQ(Check().head.entry, 1u) << "the failed one left no gap";
}

TEST_F(AuditTest, IsNeitherChangedNorDeletedBySql) {
  Fill();
  sqlite3* db = nullptr;
  ASSERT_EQ(sqlite3_open(Path().c_str(), &db), SQLITE_OK);
  for (const char* sql :
       {"UPDATE audit SET name = 'uid 9' WHERE entry = 2", "DELETE FROM audit",
        "DELETE FROM audit WHERE entry = 5",
        "INSERT OR REPLACE INTO audit SELECT * FROM audit WHERE entry = 2",
        "INSERT INTO audit SELECT entry + 10, at_ns, boot_id, door, name, role, uid, gid, pid, "
        "program, address, verb, request, request_bytes, request_sha256, taken, code, reason, "
        "configuration, previous_sha256, sha256 FROM audit WHERE entry = 2"})
    EXPECT_EQ(sqlite3_exec(db, sql, nullptr, nullptr, nullptr), SQLITE_CONSTRAINT) << sql;
  sqlite3_close(db);
  EXPECT_EQ(Flaw(), "");
  EXPECT_EQ(Check().entries, 5u);
}

TEST_F(AuditTest, AWholeChainIsWholeAndAnEmptyOneToo) {
  static_cast<void>(OpenStore());
  EXPECT_EQ(Flaw(), "");
  EXPECT_EQ(Check().head, BeforeAudit());
  Fill(20);
  EXPECT_EQ(Flaw(), "");
  EXPECT_EQ(Check().entries, 20u);
}

TEST_F(AuditTest, EachChangedColumnBreaksTheChain) {
  for (const char* set :
       {"at_ns = at_ns + 1", "boot_id = 'x'", "door = 'http'", "name = 'uid 77'", "role = 'viewer'",
        "uid = 77", "uid = NULL", "gid = 77", "pid = 77", "program = 'x'", "address = 'x'",
        "verb = 'stop'", "request = 'x'", "request_bytes = 77", "request_sha256 = 'x'",
        "taken = 0", "code = 'x'", "reason = 'x'", "configuration = 77",
        "previous_sha256 = 'x'", "sha256 = 'x'"}) {
    SCOPED_TRACE(set);
    for (const char* suffix : {"", "-wal", "-shm"}) std::filesystem::remove(Path() + suffix);
    Fill();
    Forge(std::string("UPDATE audit SET ") + set + " WHERE entry = 3");
    EXPECT_THAT(Flaw(), HasSubstr("audit entry 3"));
  }
}

TEST_F(AuditTest, AnEntryOfHttpGetsNoProcessLater) {
  AuditRow token = Of("token page", "stop");
  token.process.reset();
  ExpectDone(OpenStore()->Commit(std::vector<Row>{token}, kEight));
  Forge("UPDATE audit SET program = 'x'");
  EXPECT_THAT(Flaw(), HasSubstr("audit entry 1"));
}

TEST_F(AuditTest, AMissingEntryBreaksTheChain) {
  Fill();
  Forge("DELETE FROM audit WHERE entry = 3");
  EXPECT_THAT(Flaw(), HasSubstr("entries after 2 are missing"));
}

TEST_F(AuditTest, AMissingFrontIsFound) {
  Fill();
  Forge("DELETE FROM audit WHERE entry < 3");
  EXPECT_THAT(Flaw(), HasSubstr("the first entries are missing"));
}

TEST_F(AuditTest, ACutTailIsFound) {
  Fill();
  Forge("DELETE FROM audit WHERE entry > 3");
  EXPECT_THAT(Flaw(), HasSubstr("its tail was cut off"));
}

TEST_F(AuditTest, ACutTailWithItsCountIsFoundByAHeadReportedOutside) {
  Fill();
  const AuditHead reported = Check().head;
  Forge("DELETE FROM audit WHERE entry > 3");
  // The forger knows the program and makes the count fit, as the store itself would.
  {
    auto connection = store_internal::Connection::Open(
        Path(), store_internal::Connection::Mode::kWrite, nullptr, 1000);
    ASSERT_TRUE(connection);
    ExpectDone((*connection)->Execute("UPDATE meta SET value = 3, checksum = row_checksum(key, 3) "
                                      "WHERE key = 'audit_entries'"));
  }
  EXPECT_EQ(Flaw(), "") << "the file alone cannot show it";
  EXPECT_THAT(Check({reported}).flaw.value_or(""), HasSubstr("its tail was cut off"));
}

TEST_F(AuditTest, AChainThatWasMadeAnewIsFoundByAHeadReportedOutside) {
  Fill();
  const AuditHead reported{4, std::string(64, '7')};
  EXPECT_THAT(Check({reported}).flaw.value_or(""),
              HasSubstr("not the one that was reported outside"));
}

TEST_F(AuditTest, HeadsAreTexts) {
  Fill();
  const AuditHead head = Check().head;
  EXPECT_EQ(HeadOf(Text(head)), head);
  for (const char* text : {"", "5", "5:", ":aa", "x:aa", "5:AA", "5:zz"})
    EXPECT_FALSE(HeadOf(text)) << text;
}

TEST_F(AuditTest, AStoreWithABrokenChainStillStarts) {
  Fill();
  Forge("DELETE FROM audit WHERE entry > 1");
  const auto store = OpenStore();
  ASSERT_NE(store, nullptr);
  EXPECT_TRUE(store->Load());
  ExpectDone(store->Commit(std::vector<Row>{Of("uid 1", "stop")}, kNine));
}

}  // namespace
}  // namespace focalfleet
