// Spots are read from FITS files as other programs write them, with columns, keys and tables beside
// the wanted ones.
#include "daemon/camera/spots_fits.h"

#include <fitsio.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "daemon/files/text_file.h"
#include "protocol/base/rng.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

using ::testing::HasSubstr;

constexpr SensorLimits kSensor{1000, 1000};
constexpr const char* kTaken = "2026-11-22T03:04:05.678";

struct Column {
  std::string name;
  std::string form;
};

/// SpotFile is a file that cfitsio writes, with three spots in its table.
class SpotFile {
 public:
  SpotFile() {
    EXPECT_EQ(fits_create_diskfile(&file_, Path().c_str(), &status_), 0);
    fits_create_img(file_, BYTE_IMG, 0, nullptr, &status_);
  }
  ~SpotFile() {
    int ignored = 0;
    if (file_ != nullptr) fits_close_file(file_, &ignored);
  }
  SpotFile(const SpotFile&) = delete;
  SpotFile& operator=(const SpotFile&) = delete;

  [[nodiscard]] fitsfile* file() const { return file_; }
  int* status() { return &status_; }

  void TextKey(const char* name, const char* value) {
    fits_write_key(file_, TSTRING, name, const_cast<char*>(value), "", &status_);
  }
  void Keys() {
    TextKey("EXPID", "night 1");
    TextKey("DATE-OBS", kTaken);
  }
  void Table(const std::vector<Column>& columns, long rows = 3) {
    std::vector<char*> names;
    std::vector<char*> forms;
    for (const Column& column : columns) {
      names.push_back(const_cast<char*>(column.name.c_str()));
      forms.push_back(const_cast<char*>(column.form.c_str()));
    }
    fits_create_tbl(file_, BINARY_TBL, rows, static_cast<int>(names.size()), names.data(),
                    forms.data(), nullptr, "SPOTS", &status_);
  }
  template <class T>
  void Values(int type, int column, std::vector<T> values) {
    fits_write_col(file_, type, column, 1, 1, static_cast<LONGLONG>(values.size()), values.data(),
                   &status_);
  }
  /// The four wanted columns are written from column `first` on.
  void Spots(int first) {
    Values<int>(TINT, first, {1, 2, 3});
    Values<double>(TDOUBLE, first + 1, {10.5, 20, 30});
    Values<double>(TDOUBLE, first + 2, {1, 2, 3});
    Values<double>(TDOUBLE, first + 3, {5, 6, 7});
  }
  std::string Bytes() {
    fits_close_file(file_, &status_);
    file_ = nullptr;
    EXPECT_EQ(status_, 0);
    return ReadFile(Path()).value();
  }
  Result<Exposure> Read() { return ParseSpotsFits(Bytes(), "s.fits", kSensor); }

 private:
  [[nodiscard]] std::string Path() const { return folder_ / "s.fits"; }
  test::ScratchFolder folder_;
  fitsfile* file_ = nullptr;
  int status_ = 0;
};

const std::vector<Column> kWanted = {
    {"SPOT_ID", "1J"}, {"X_PX", "1D"}, {"Y_PX", "1D"}, {"FLUX", "1D"}};

std::vector<Column> With(const std::vector<Column>& more) {
  std::vector<Column> columns = more;
  columns.insert(columns.end(), kWanted.begin(), kWanted.end());
  return columns;
}

void ExpectThreeSpots(const Result<Exposure>& exposure) {
  ASSERT_TRUE(exposure) << exposure.error().text;
  EXPECT_EQ(exposure->id, "night 1");
  ASSERT_EQ(exposure->spots.size(), 3u);
  EXPECT_EQ(exposure->spots[0].x_px, 10.5);
  EXPECT_EQ(exposure->spots[2].id, 3u);
  EXPECT_EQ(exposure->spots[2].flux, 7);
}

std::string ErrorOf(const Result<Exposure>& exposure) {
  return exposure ? "it was read" : exposure.error().text;
}

TEST(SpotsFits, ColumnsBesideTheWantedOnesDoNotMatter) {
  for (const char* form : {"1L", "8X", "1B", "1I", "3D", "4J", "0D", "1C", "1M", "2M", "1PJ(3)",
                           "1QD(2)", "12A", "20A5", "0A", "1E", "1K"}) {
    SpotFile file;
    file.Table(With({{"OTHER", form}}));
    file.Spots(2);
    file.Keys();
    ExpectThreeSpots(file.Read());
  }
}

TEST(SpotsFits, MissingValuesInAColumnThatNobodyNeedsDoNotMatter) {
  SpotFile file;
  file.Table(With({{"PEAK", "1I"}}));
  long none = -1;
  fits_write_key(file.file(), TLONG, "TNULL1", &none, "", file.status());
  file.Values<short>(TSHORT, 1, {4, -1, 9});
  file.Spots(2);
  file.Keys();
  ExpectThreeSpots(file.Read());
}

TEST(SpotsFits, KeysMayBeNumbersAndStandInThePrimaryHeader) {
  {
    SpotFile file;
    file.Keys();  // of the primary header, which is the current one
    file.Table(kWanted);
    file.Spots(1);
    ExpectThreeSpots(file.Read());
  }
  {
    SpotFile file;
    file.TextKey("EXPID", "of the file");
    file.Table(kWanted);
    file.Spots(1);
    file.Keys();
    ExpectThreeSpots(file.Read());
  }
  SpotFile file;
  file.TextKey("DATE-OBS", kTaken);
  file.Table(kWanted);
  file.Spots(1);
  int number = 100'234;
  fits_write_key(file.file(), TINT, "EXPID", &number, "", file.status());
  const auto exposure = file.Read();
  ASSERT_TRUE(exposure) << exposure.error().text;
  EXPECT_EQ(exposure->id, "100234");
}

TEST(SpotsFits, TheFirstTableWithTheColumnsIsMeant) {
  SpotFile file;
  long sides[] = {40, 30};
  fits_create_img(file.file(), SHORT_IMG, 2, sides, file.status());
  file.Table({{"FIDUCIAL", "1J"}, {"FLAG", "1L"}});
  file.Table(kWanted);
  file.Spots(1);
  file.Keys();
  file.Table(kWanted);
  ExpectThreeSpots(file.Read());
}

TEST(SpotsFits, NumbersMayBeOfAnyType) {
  for (const char* id : {"1B", "1I", "1J", "1K", "1E", "1D"})
    for (const char* place : {"1E", "1D"}) {
      SpotFile file;
      file.Table(
          {{"spot_id", id}, {"X_px", place}, {"Y_PX", place}, {"FLUX", "1J"}, {"FWHM_PX", "1E"}});
      file.Spots(1);
      file.Values<double>(TDOUBLE, 5, {2.5, std::nan(""), 0});
      file.Keys();
      const auto exposure = file.Read();
      ExpectThreeSpots(exposure);
      EXPECT_EQ(exposure->spots[0].fwhm_px, 2.5);
      EXPECT_EQ(exposure->spots[1].fwhm_px, 0) << "not measured, as in an empty cell";
    }
}

TEST(SpotsFits, WhatIsWrongIsNamed) {
  const auto error_of = [](const std::vector<Column>& columns,
                           const std::function<void(SpotFile*)>& fill) {
    SpotFile file;
    file.Table(columns);
    fill(&file);
    return ErrorOf(file.Read());
  };
  const auto good = [](SpotFile* file) {
    file->Spots(1);
    file->Keys();
  };
  EXPECT_EQ(error_of(kWanted, good), "it was read");
  EXPECT_EQ(error_of({{"SPOT_ID", "1J"}, {"X_PX", "1D"}}, [](SpotFile* file) { file->Keys(); }),
            "s.fits: no table has what is wanted; the first, 'SPOTS', lacks column Y_PX FLUX");
  EXPECT_EQ(error_of({{"SPOT_ID", "1L"}, {"X_PX", "1D"}, {"Y_PX", "1D"}, {"FLUX", "1D"}},
                     [](SpotFile* file) { file->Keys(); }),
            "s.fits: column SPOT_ID has not one number a row");
  EXPECT_EQ(error_of({{"SPOT_ID", "1J"}, {"X_PX", "2D"}, {"Y_PX", "1D"}, {"FLUX", "1D"}},
                     [](SpotFile* file) { file->Keys(); }),
            "s.fits: column X_PX has not one number a row");
  EXPECT_EQ(error_of({{"SPOT_ID", "4A"}, {"X_PX", "1D"}, {"Y_PX", "1D"}, {"FLUX", "1D"}},
                     [](SpotFile* file) { file->Keys(); }),
            "s.fits: column SPOT_ID holds text");
  EXPECT_EQ(error_of(With({{"X_PX", "1D"}}), [](SpotFile* file) { file->Keys(); }),
            "s.fits: column X_PX is there twice");
  EXPECT_EQ(error_of({{"SPOT_ID", "1D"}, {"X_PX", "1D"}, {"Y_PX", "1D"}, {"FLUX", "1D"}},
                     [&](SpotFile* file) {
                       good(file);
                       file->Values<double>(TDOUBLE, 1, {1, 2.5, 3});
                     }),
            "s.fits: row 2: SPOT_ID 2.5 is no whole number from 0 to 4294967295");
  EXPECT_EQ(error_of(kWanted,
                     [&](SpotFile* file) {
                       good(file);
                       long none = 2;
                       fits_write_key(file->file(), TLONG, "TNULL1", &none, "", file->status());
                     }),
            "s.fits: column SPOT_ID: the value is missing in row 2");
  EXPECT_EQ(error_of(kWanted, [](SpotFile* file) { file->Spots(1); }),
            "s.fits: key EXPID is missing");
  EXPECT_EQ(error_of(kWanted,
                     [](SpotFile* file) {
                       file->Spots(1);
                       double half = 0.5;
                       fits_write_key(file->file(), TDOUBLE, "EXPID", &half, "", file->status());
                     }),
            "s.fits: key EXPID is neither a text nor a whole number");
  EXPECT_EQ(error_of(kWanted,
                     [](SpotFile* file) {
                       file->Spots(1);
                       file->TextKey("EXPID", std::string(65, 'x').c_str());
                     }),
            "s.fits: EXPID: is longer than 64 characters");
  EXPECT_EQ(error_of(kWanted,
                     [](SpotFile* file) {
                       file->Spots(1);
                       file->TextKey("EXPID", "x");
                       file->TextKey("DATE-OBS", "yesterday");
                     }),
            "s.fits: DATE-OBS 'yesterday' is no time in UTC");
}

/// Returns the bytes with `value` in the card `key` of every header.
std::string Lying(std::string bytes, const std::string& key, const std::string& value) {
  const std::string card = (key + std::string(8 - key.size(), ' ') + "= ");
  for (std::size_t at = bytes.find(card); at != std::string::npos; at = bytes.find(card, at + 80))
    if (at % 80 == 0) bytes.replace(at + 10, 20, std::string(20 - value.size(), ' ') + value);
  return bytes;
}

TEST(SpotsFits, NothingIsMadeAsLargeAsAHeaderSays) {
  SpotFile file;
  file.Table(With({{"NAME", "16A"}}));
  file.Spots(2);
  file.Keys();
  const std::string bytes = file.Bytes();
  ExpectThreeSpots(ParseSpotsFits(bytes, "s.fits", kSensor));
  EXPECT_EQ(ErrorOf(ParseSpotsFits(Lying(bytes, "NAXIS2", "131072"), "s.fits", kSensor)),
            "s.fits: unit 1: its data are cut short");
  for (const auto& [key, value] : {std::pair("TFORM1", "'1000000000A'"),
                                   {"TFORM2", "'999999999J'"},
                                   {"NAXIS1", "2000000000"},
                                   {"NAXIS1", "0"},
                                   {"NAXIS2", "-1"},
                                   {"TFIELDS", "999"}}) {
    const auto read = ParseSpotsFits(Lying(bytes, key, value), "s.fits", kSensor);
    EXPECT_FALSE(read) << key;
    EXPECT_THAT(ErrorOf(read), HasSubstr("s.fits: "));
  }
}

TEST(SpotsFits, MoreRowsThanAnExposureHasSpotsAreRefused) {
  SpotFile file;
  file.Table(kWanted, 131'073);
  file.Keys();
  EXPECT_EQ(ErrorOf(file.Read()), "s.fits: 131073 rows are more than 131072");
}

// A header without one of its mandatory cards makes cfitsio take the number of columns from
// uninitialised memory. Fuzzing found it.
TEST(SpotsFits, AHeaderWithoutAMandatoryCardIsRefused) {
  SpotFile file;
  file.Table(kWanted);
  file.Spots(1);
  file.Keys();
  const std::string bytes = file.Bytes();
  const std::size_t table = bytes.find("XTENSION");
  for (const auto& [key, reported] : {std::pair("BITPIX  =", "BITPIX is not in its place"),
                                      {"NAXIS   =", "NAXIS is not in its place"},
                                      {"NAXIS1  =", "the length of an axis is not in its place"},
                                      {"NAXIS2  =", "the length of an axis is not in its place"},
                                      {"PCOUNT  =", "PCOUNT or GCOUNT is not in its place"},
                                      {"GCOUNT  =", "PCOUNT or GCOUNT is not in its place"},
                                      {"TFIELDS =", "TFIELDS is not in its place"},
                                      {"END     ", "its header does not end"}}) {
    std::string without = bytes;
    without.replace(without.find(key, table), 8, "HISTORY ");
    EXPECT_EQ(ErrorOf(ParseSpotsFits(without, "s.fits", kSensor)),
              "s.fits: unit 1: " + std::string(reported));
  }
}

TEST(SpotsFits, AnyHeaderGivesSpotsOrAnError) {
  SpotFile file;
  file.Keys();
  file.Table(With({{"NAME", "16A"}, {"LIST", "1PJ(3)"}, {"SUM", "1I"}}));
  file.Spots(4);
  const std::string bytes = file.Bytes();
  const std::uint64_t seed = test::TestSeed(17);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  constexpr const char* kValues[] = {"0",
                                     "1",
                                     "-1",
                                     "3",
                                     "44",
                                     "999",
                                     "1000",
                                     "9223372036854775807",
                                     "1E300",
                                     "nan",
                                     "T",
                                     "'1J'",
                                     "'999999999J'",
                                     "'1D'",
                                     "'0D'",
                                     "'1PJ(9)'",
                                     "'X'",
                                     "''",
                                     "'SPOT_ID'",
                                     "(1,2)",
                                     "/",
                                     "="};
  constexpr const char* kKeys[] = {"TSCAL4", "TZERO4", "TNULL4",   "TDIM4",  "THEAP", "ZIMAGE",
                                   "TFORM4", "TFORM9", "CONTINUE", "GROUPS", "EXPID"};
  for (int k = 0; k < 4000; ++k) {
    std::string changed = bytes;
    for (std::uint64_t n = 1 + rng.Below(3); n > 0; --n) {
      const std::size_t card = 80 * rng.Below(changed.size() / 80);
      if (rng.Below(2) != 0) {
        const std::string key = kKeys[rng.Below(std::size(kKeys))];
        changed.replace(card, 8, key + std::string(8 - key.size(), ' '));
      }
      std::string value = kValues[rng.Below(std::size(kValues))];
      value.resize(30, ' ');
      changed.replace(card + 8, 32, "= " + value);
    }
    const auto exposure = ParseSpotsFits(changed, "s.fits", kSensor);
    EXPECT_TRUE(exposure || exposure.error().text.starts_with("s.fits: "));
  }
}

TEST(SpotsFits, AFileCutAnywhereIsRefused) {
  SpotFile file;
  file.Table(kWanted, 3);
  file.Spots(1);
  file.Keys();
  const std::string bytes = file.Bytes();
  const std::size_t data_end = bytes.size() - 2880 + 3 * 28;
  for (std::size_t size = 0; size < data_end; size += 97)
    EXPECT_FALSE(ParseSpotsFits(bytes.substr(0, size), "s.fits", kSensor)) << size;
  EXPECT_THAT(ErrorOf(ParseSpotsFits("spot_id,x_px\n", "s.fits", kSensor)),
              HasSubstr("s.fits: this is no FITS file"));
}

}  // namespace
}  // namespace focalfleet
