#include "daemon/camera/camera_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <fstream>

#include "daemon/camera/camera_work.h"
#include "daemon/camera/spots_fits.h"
#include "daemon/files/text_file.h"
#include "fleet/files/spots_file.h"
#include "fleet/hex_layout.h"
#include "protocol/base/limits.h"
#include "tests/support/as_user.h"
#include "tests/support/gzip.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

namespace fs = std::filesystem;
using test::AsUser;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr SensorLimits kSensor{1000, 1000};
constexpr WallTime kSince{1'795'316'645'678'000'000};

Exposure Three(const std::string& id) {
  return {id, kSince.ns, {{1, 10.5, 20, 1, 2}, {2, 30, 40, 2, 2}, {3, 5, 6, 3, 2}}};
}

class CameraFolderTest : public ::testing::TestWithParam<uid_t> {
 protected:
  CameraFolderTest() : user_(GetParam()), files_(std::make_unique<test::ScratchFolder>()) {
    std::ofstream(*files_ / "secret") << "secret";
  }
  ~CameraFolderTest() override {
    EXPECT_EQ(ReadTextFile(*files_ / "secret").value_or("none"), "secret");
    std::error_code ignored;
    fs::permissions(File(""), fs::perms::owner_all, ignored);
    fs::permissions(File("taken"), fs::perms::owner_all, ignored);
  }
  void Open() { folder_ = CameraFolder::Open(*files_ / "camera", kSensor).value(); }
  [[nodiscard]] std::string File(const std::string& name) const {
    return *files_ / ("camera/" + name);
  }
  void Put(const std::string& name, const std::string& bytes) const {
    ASSERT_TRUE(WriteFileAtomically(File(name), bytes));
  }
  [[nodiscard]] std::string FitsOf(const Exposure& exposure) const {
    EXPECT_TRUE(WriteSpotsFits(*files_ / "made.fits", exposure));
    return ReadFile(*files_ / "made.fits").value();
  }
  [[nodiscard]] static bool Exists(const std::string& path) {
    struct stat status {};
    return lstat(path.c_str(), &status) == 0;
  }
  [[nodiscard]] std::string TakenId() const {
    const auto taken = folder_->Take();
    return !taken ? taken.error().text : !*taken ? "nothing" : (*taken)->id;
  }
  /// The file is in refused/ with its reason, and the folder takes the next file.
  void ExpectRefused(const std::string& name, const std::string& reason) const {
    EXPECT_THAT(TakenId(), HasSubstr(reason)) << name;
    EXPECT_FALSE(Exists(File(name)));
    EXPECT_TRUE(Exists(File("refused/" + name)));
    EXPECT_THAT(ReadTextFile(File("refused/" + name + ".reason")).value_or("none"),
                HasSubstr(reason));
    EXPECT_EQ(TakenId(), "nothing");
  }

  AsUser user_;
  std::unique_ptr<test::ScratchFolder> files_;
  std::unique_ptr<CameraFolder> folder_;
};

INSTANTIATE_TEST_SUITE_P(Users, CameraFolderTest, ::testing::ValuesIn(test::UsersOfTests()),
                         test::NameOfUser);

TEST_P(CameraFolderTest, AsksByAFileThatIsThereAsAWhole) {
  Open();
  ASSERT_TRUE(folder_->Request(12, kSince));
  const auto text = ReadTextFile(File("request.json"));
  ASSERT_TRUE(text);
  EXPECT_THAT(*text, HasSubstr("\"exposure\": 12"));
  EXPECT_THAT(*text, HasSubstr(UtcOf(kSince.ns)));
}

TEST_P(CameraFolderTest, TakesSpotListsInTheOrderOfTheirNamesWhateverHoldsThem) {
  Open();
  const std::string csv = WriteSpots(Three("csv"));
  Put("a.csv", csv);
  Put("b.fits", FitsOf(Three("fits")));
  Put("c.csv.gz", test::Gzipped(WriteSpots(Three("csv.gz"))));
  Put("d.fits.gz", test::Gzipped(FitsOf(Three("fits.gz"))));
  Put("e.FIT", FitsOf(Three("fit")));
  Put("f.fts.GZ", test::Gzipped(FitsOf(Three("fts.gz"))));
  Put("g.csv", FitsOf(Three("fits called csv")));
  for (const char* id : {"csv", "fits", "csv.gz", "fits.gz", "fit", "fts.gz", "fits called csv"}) {
    const auto taken = folder_->Take();
    ASSERT_TRUE(taken) << taken.error().text;
    ASSERT_TRUE(*taken);
    EXPECT_EQ((*taken)->id, id);
    EXPECT_EQ((*taken)->taken_unix_ns, kSince.ns);
    ASSERT_EQ((*taken)->spots.size(), 3u);
    EXPECT_EQ((*taken)->spots[0].x_px, 10.5);
  }
  EXPECT_EQ(TakenId(), "nothing");
  EXPECT_EQ(ReadTextFile(File("taken/a.csv")).value(), csv);
}

TEST_P(CameraFolderTest, WhatIsNoExposureIsSetAsideWithItsReason) {
  Open();
  const std::string csv = WriteSpots(Three("x"));
  const std::string packed = test::Gzipped(csv);
  const struct {
    const char* name;
    std::string bytes;
    const char* reason;
  } cases[] = {
      {"bad.csv", "spot_id,x_px\n1,NaN\n", "bad.csv"},
      {"bad.fits", "no table", "bad.fits"},
      {"empty.fits", "", "empty.fits"},
      {"cut.csv.gz", packed.substr(0, packed.size() / 2), "its gzip stream is cut short"},
      {"plain.csv.gz.csv", test::Gzipped(packed), "this is compressed with gzip"},
      {"x.csv.bz2", "BZh9", "spots come as .csv, .fits, .fit or .fts"},
      {"x.fits.fz", "SIMPLE  =", "spots come as .csv"},
      {"spots.txt", csv, "spots come as .csv"},
      {"log.gz", packed, "spots come as .csv"},
      {"SPOTS.ECSV", csv, "spots come as .csv"},
      {"x.parquet", "PAR1", "spots come as .csv"},
  };
  for (const auto& c : cases) {
    Put(c.name, c.bytes);
    ExpectRefused(c.name, c.reason);
  }
}

TEST_P(CameraFolderTest, TellsAllBadSpotsInTheReason) {
  Open();
  Put("bad.csv",
      "# exposure_id: a\n# taken_utc: 2026-11-22T03:04:05Z\nspot_id,x_px,y_px,flux\n"
      "1,nan,2,1\n2,3,4,1\n3,5,6,-1\n");
  ExpectRefused("bad.csv", "bad.csv:4: column x_px: the value is missing (empty or nan)\n  " +
                               File("bad.csv") + ":6: column flux: -1 is not above 0");
}

TEST_P(CameraFolderTest, OtherNamesAreLeftAloneForTheCameraMayBeWritingThem) {
  Open();
  for (const char* name : {"x.csv.part", "x.fits.tmp", "part", ".x.csv", "x.csv~", "camera.log",
                           "side.json", "x.csv.gz.filepart"}) {
    Put(name, WriteSpots(Three("x")));
    EXPECT_EQ(TakenId(), "nothing");
    EXPECT_TRUE(Exists(File(name)));
  }
  fs::rename(File("x.csv.part"), File("x.csv"));
  EXPECT_EQ(TakenId(), "x");
}

TEST_P(CameraFolderTest, WhatLayThereBeforeAnswersNothing) {
  Open();
  Put("old.csv", WriteSpots(Three("old")));
  ASSERT_EQ(mkfifo(File("old.fits").c_str(), 0600), 0);
  folder_.reset();
  Open();
  EXPECT_EQ(TakenId(), "nothing");
  EXPECT_TRUE(Exists(File("refused/old.csv")));
  EXPECT_TRUE(Exists(File("refused/old.fits")));
}

TEST_P(CameraFolderTest, ARequestIsWrittenIntoNothingOfOthers) {
  Open();
  ASSERT_EQ(symlink("../secret", File("request.json").c_str()), 0);
  ASSERT_TRUE(folder_->Request(1, kSince));
  EXPECT_THAT(ReadTextFile(File("request.json")).value(), HasSubstr("\"exposure\": 1"));
  fs::remove(File("request.json"));
  ASSERT_EQ(mkfifo(File("request.json").c_str(), 0600), 0);
  ASSERT_TRUE(folder_->Request(2, kSince));
  EXPECT_THAT(ReadTextFile(File("request.json")).value(), HasSubstr("\"exposure\": 2"));
  fs::remove(File("request.json"));
  fs::create_directories(File("request.json/theirs"));
  const Status asked = folder_->Request(3, kSince);
  ASSERT_FALSE(asked);
  EXPECT_THAT(asked.error().text, HasSubstr("request.json: cannot be written: Is a directory"));
  EXPECT_TRUE(Exists(File("request.json/theirs")));
}

TEST_P(CameraFolderTest, WhatIsNoFileIsRefusedWithoutLookingIntoIt) {
  Open();
  ASSERT_EQ(symlink("../secret", File("link.csv").c_str()), 0);
  ExpectRefused("link.csv", "link.csv: a symbolic link, no file");
  ASSERT_EQ(symlink("/dev/zero", File("zero.fits").c_str()), 0);
  ExpectRefused("zero.fits", "a symbolic link, no file");
  ASSERT_EQ(mkfifo(File("pipe.fits.gz").c_str(), 0600), 0);
  ExpectRefused("pipe.fits.gz", "a named pipe, no file");
  fs::create_directories(File("folder.csv/theirs"));
  ExpectRefused("folder.csv", "a folder, no file");
  EXPECT_TRUE(Exists(File("refused/folder.csv/theirs")));
}

TEST_P(CameraFolderTest, ADropPlaceIsAllThatTheCameraNeeds) {
  folder_ =
      CameraFolder::Open(*files_ / "camera", kSensor, CameraFolder::Place::kDropPlace).value();
  for (const std::string& folder : {*files_ / "", File("")})
    fs::permissions(folder, fs::perms::group_exec | fs::perms::others_exec, fs::perm_options::add);
  fs::permissions(File("drop"), fs::perms::all);
  ASSERT_TRUE(folder_->Request(1, kSince));
  {
    // The camera's account; where this test is not root's it is the daemon's own.
    const AsUser camera(GetParam() == 0 ? test::UsersOfTests().back() : GetParam());
    Put("drop/x.csv", WriteSpots(Three("x")));
    if (GetParam() == 0) {
      EXPECT_FALSE(WriteFileAtomically(File("request.json"), "{}"));
      EXPECT_FALSE(WriteFileAtomically(File("taken/x.csv"), "forged"));
    }
  }
  Put("beside.csv", WriteSpots(Three("beside")));
  EXPECT_EQ(TakenId(), "x");
  EXPECT_TRUE(Exists(File("taken/x.csv")));
  EXPECT_FALSE(Exists(File("drop/x.csv")));
  EXPECT_EQ(TakenId(), "nothing");
  EXPECT_TRUE(Exists(File("beside.csv"))) << "beside the drop place nothing is looked at";
}

TEST_P(CameraFolderTest, ALinkToWhereThingsAreSetAsideIsRefused) {
  for (const char* part : {"taken", "refused"}) {
    fs::create_directories(File(""));
    fs::create_directories(*files_ / "theirs");
    ASSERT_EQ(symlink("../theirs", File(part).c_str()), 0);
    const auto folder = CameraFolder::Open(*files_ / "camera", kSensor);
    ASSERT_FALSE(folder);
    EXPECT_EQ(folder.error().code, ErrorCode::kUnavailable);
    EXPECT_THAT(folder.error().text, HasSubstr(std::string(part) + ": a symbolic link"));
    fs::remove(File(part));
  }
  // A folder that is exchanged later changes nothing: the port holds the first one open.
  Open();
  fs::rename(File("refused"), File("gone"));
  ASSERT_EQ(symlink("../theirs", File("refused").c_str()), 0);
  Put("bad.csv", "no spots\n");
  EXPECT_THAT(TakenId(), HasSubstr("bad.csv"));
  EXPECT_TRUE(Exists(File("gone/bad.csv")));
  EXPECT_TRUE(fs::is_empty(*files_ / "theirs"));
  EXPECT_THAT(folder_->Request(1, kSince).error().text, HasSubstr("refused: a symbolic link"));
}

TEST_P(CameraFolderTest, AFolderThatIsMadeAnewIsLookedIntoFromTheNextRequest) {
  Open();
  fs::remove_all(File(""));
  ASSERT_TRUE(folder_->Request(1, kSince));
  Put("x.csv", WriteSpots(Three("x")));
  EXPECT_EQ(TakenId(), "x");
}

TEST_P(CameraFolderTest, TooManyFilesHoldNoStartAndAreReportedWhenAnExposureIsDue) {
  fs::create_directories(File(""));
  for (std::size_t n = 0; n <= limits::kCameraFiles; ++n)
    std::ofstream(File("x" + std::to_string(n) + ".tmp"));
  Open();
  const auto taken = folder_->Take();
  ASSERT_FALSE(taken);
  EXPECT_THAT(taken.error().text, HasSubstr("clear it up"));
}

TEST_P(CameraFolderTest, WhatCannotBeMovedIsTakenOnceAndStays) {
  Open();
  Put("a.csv", WriteSpots(Three("a")));
  Put("b.csv", "no spots\n");
  fs::permissions(File(""), fs::perms::owner_read | fs::perms::owner_exec);
  const bool root = GetParam() == 0;  // root may move files all the same
  EXPECT_EQ(TakenId(), "a");
  EXPECT_THAT(TakenId(), HasSubstr("b.csv"));
  EXPECT_EQ(TakenId(), "nothing");
  EXPECT_EQ(Exists(File("a.csv")), !root);
  EXPECT_EQ(folder_->Request(1, kSince).has_value(), root);
  // At the next start the file would be refused again and again.
  folder_.reset();
  Open();
  EXPECT_EQ(TakenId(), "nothing");
  fs::permissions(File(""), fs::perms::owner_all);
  EXPECT_EQ(TakenId(), "nothing") << "the same file";
  Put("b.csv", WriteSpots(Three("b anew")));
  EXPECT_EQ(TakenId(), "b anew");
}

TEST_P(CameraFolderTest, LongNamesAndStrangeOnesAreSetAsideToo) {
  Open();
  const std::string name(251, 'x');
  std::ofstream(File(name + ".csv")) << "no spots\n";
  EXPECT_THAT(TakenId(), HasSubstr("xxx.csv"));
  EXPECT_TRUE(Exists(File("refused/" + name + ".csv")));
  EXPECT_TRUE(Exists(File("refused/" + name.substr(0, 240) + ".reason")));
  std::ofstream(File("a\nforged.csv")) << "no spots\n";
  EXPECT_THAT(TakenId(), HasSubstr("camera/a?forged.csv"));
  EXPECT_EQ(TakenId(), "nothing");
}

// The camera's thread ends when the daemon ends, whatever the folder contains.
TEST_P(CameraFolderTest, NothingInTheFolderHoldsTheCamerasThread) {
  Open();
  for (const char* name : {"request.json", "a.csv", "b.fits", "c.csv.gz"})
    ASSERT_EQ(mkfifo(File(name).c_str(), 0600), 0);
  const auto layout = Layout::Create(MakeHexLayout({.count = 1}), {});
  CameraWorker::Options options{.layout = &*layout,
                                .site = {},
                                .patience = std::chrono::milliseconds(5),
                                .pause = std::chrono::milliseconds(1)};
  CameraWorker worker(std::move(folder_), std::move(options));
  const std::atomic<bool> ending{false};
  const ExposureDone done = worker.Do({}, ending);
  ASSERT_FALSE(done.exposure);
  EXPECT_THAT(done.exposure.error().text, HasSubstr("a named pipe, no file"));
}

TEST(CameraFile, IsKnownByItsEnding) {
  for (const char* name : {"a.csv", "a.fits", "a.fit", "a.fts", "a.csv.gz", "A.FITS.GZ", "a.b.csv"})
    EXPECT_EQ(KindOfName(name), CameraFile::kSpots) << name;
  for (const char* name : {"a.gz", "a.csv.bz2", "a.tgz", "a.txt", "a.fits.fz", "a.xlsx"})
    EXPECT_EQ(KindOfName(name), CameraFile::kForeign) << name;
  for (const char* name : {"", "csv", ".csv", "request.json", "taken", "a.csv.part", "a.csv.tmp"})
    EXPECT_EQ(KindOfName(name), CameraFile::kNotOurs) << name;
}

}  // namespace
}  // namespace focalfleet
