#include "daemon/camera/camera_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "daemon/camera/spots_fits.h"
#include "daemon/files/text_file.h"
#include "fleet/files/spots_file.h"
#include "tests/support/temporary_folder.h"

namespace focalfleet {
namespace {

using ::testing::HasSubstr;

constexpr SensorLimits kSensor{1000, 1000};

Exposure Three(const std::string& id) {
  return {id, 1'795'316'645'678'000'000, {{1, 10.5, 20, 1, 2}, {2, 30, 40, 2, 2}, {3, 5, 6, 3, 2}}};
}

class CameraFolderTest : public ::testing::Test {
 protected:
  void Open() { folder_ = CameraFolder::Open(files_.File("camera"), kSensor).value(); }
  [[nodiscard]] std::string File(const std::string& name) const {
    return files_.File("camera/" + name);
  }
  testing::TemporaryFolder files_;
  std::unique_ptr<CameraFolder> folder_;
};

TEST_F(CameraFolderTest, AsksByAFileThatIsThereAsAWhole) {
  Open();
  ASSERT_TRUE(folder_->Request(12, {1'795'316'645'678'000'000}));
  const auto text = ReadTextFile(File("request.json"));
  ASSERT_TRUE(text);
  EXPECT_THAT(*text, HasSubstr("\"exposure\": 12"));
  EXPECT_THAT(*text, HasSubstr(UtcOf(1'795'316'645'678'000'000)));
}

TEST_F(CameraFolderTest, TakesSpotListsInTheOrderOfTheirNamesCsvAndFitsAlike) {
  Open();
  ASSERT_TRUE(WriteFileAtomically(File("b.csv"), WriteSpots(Three("second"))));
  ASSERT_TRUE(WriteSpotsFits(File("a.fits"), Three("first")));
  for (const char* id : {"first", "second"}) {
    const auto taken = folder_->Take();
    ASSERT_TRUE(taken) << taken.error().text;
    ASSERT_TRUE(*taken);
    EXPECT_EQ((*taken)->id, id);
    EXPECT_EQ((*taken)->taken_unix_ns, Three(id).taken_unix_ns);
    ASSERT_EQ((*taken)->spots.size(), 3u);
    EXPECT_EQ((*taken)->spots[0].x_px, 10.5);
  }
  const auto nothing = folder_->Take();
  ASSERT_TRUE(nothing);
  EXPECT_FALSE(*nothing);
  EXPECT_TRUE(std::filesystem::exists(File("taken/b.csv")));
}

TEST_F(CameraFolderTest, WhatIsNoExposureIsSetAsideWithItsReason) {
  Open();
  ASSERT_TRUE(WriteFileAtomically(File("bad.csv"), "spot_id,x_px\n1,NaN\n"));
  ASSERT_TRUE(WriteFileAtomically(File("bad.fits"), "no table"));
  for (const char* name : {"bad.csv", "bad.fits"}) {
    const auto taken = folder_->Take();
    ASSERT_FALSE(taken);
    EXPECT_THAT(taken.error().text, HasSubstr(name));
    EXPECT_TRUE(std::filesystem::exists(File(std::string("refused/") + name)));
    EXPECT_TRUE(std::filesystem::exists(File(std::string("refused/") + name + ".reason")));
  }
  EXPECT_FALSE(*folder_->Take());
}

TEST_F(CameraFolderTest, WhatLayThereBeforeAnswersNothing) {
  Open();
  ASSERT_TRUE(WriteFileAtomically(File("old.csv"), WriteSpots(Three("old"))));
  folder_.reset();
  Open();
  EXPECT_FALSE(*folder_->Take());
  EXPECT_TRUE(std::filesystem::exists(File("refused/old.csv")));
}

}  // namespace
}  // namespace focalfleet
