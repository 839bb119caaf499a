#include "fleet/files/foreign_format.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "fleet/files/csv.h"

namespace focalfleet {
namespace {

using namespace std::string_literals;
using ::testing::HasSubstr;

TEST(ForeignFormat, SaysWhatItIsAndWhatToDo) {
  const struct {
    std::string bytes;
    const char* what;
    const char* to_do;
  } cases[] = {
      {"SIMPLE  =                    T", "FITS", "write its table as CSV"},
      {"\x1f\x8b\x08\0\0\0\0\0"s, "gzip", "gunzip"},
      {"\x1f\x9d\x90"s, "compress", "uncompress"},
      {"BZh91AY&SY\x01\x02"s, "bzip2", "bunzip2"},
      {"BZh9\x17\x72\x45\x38\x50\x90\0\0"s, "bzip2", "bunzip2"},
      {"\xfd\x37zXZ\0\0\x04"s, "xz", "unxz"},
      {"\x28\xb5\x2f\xfd\x04"s, "zstd", "unzstd"},
      {"\x04\x22\x4d\x18\x64"s, "lz4", "unlz4"},
      {"7z\xbc\xaf\x27\x1c\0"s, "7z", "unpack"},
      {std::string(257, 't') + "ustar\0"s, "tar", "tar -xf"},
      {"PK\x03\x04\x14\0\x06\0\x08[Content_Types].xml"s, "spreadsheet", "save the sheet as CSV"},
      {"PK\x03\x04\x14\0mimetypeapplication/vnd.oasis.opendocument.spreadsheet"s, "spreadsheet",
       "save the sheet as CSV"},
      {"PK\x03\x04\x14\0\0\0x.npy\x93NUMPY"s, "NumPy", "write them as CSV"},
      {"PK\x05\x06\0\0"s, "ZIP", "unpack"},
      {"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"s, "Excel", "save the sheet as CSV"},
      {"\x89HDF\r\n\x1a\n\0"s, "HDF5", "to_csv"},
      {std::string(512, 'u') + "\x89HDF\r\n\x1a\n"s, "HDF5", "to_csv"},
      {"SQLite format 3\0\x10"s, "SQLite", "sqlite3 -header -csv"},
      {"PAR1\x15\0\x15\x10\x01PAR1"s, "Parquet", "to_csv"},
      {"ARROW1\0\0"s, "Feather", "to_csv"},
      {"\x93NUMPY\x01\0"s, "NumPy", "write it as CSV"},
      {"%PDF-1.7\n", "PDF", ""},
      {"\xff\xfeu\0n\0"s, "UTF-16", "save it as UTF-8"},
      {"\xfe\xff\0u\0n"s, "UTF-16", "save it as UTF-8"},
      {"\xff\xfe\0\0u\0\0\0"s, "UTF-32", "save it as UTF-8"},
      {"u\0n\0i\0t\0_\0"s, "UTF-16", "save it as UTF-8"},
      {"\0u\0n\0i\0t\0_"s, "UTF-16", "save it as UTF-8"},
  };
  for (const auto& c : cases) {
    const auto reported = ForeignFormat(c.bytes);
    ASSERT_TRUE(reported) << c.what;
    EXPECT_THAT(*reported, HasSubstr(c.what));
    EXPECT_THAT(*reported, HasSubstr(c.to_do));
    const auto table = CsvTable::Parse(c.bytes, "t.csv");
    ASSERT_FALSE(table);
    EXPECT_EQ(table.error().text, "t.csv: this is " + *reported);
  }
}

TEST(ForeignFormat, LeavesTextAlone) {
  for (const char* text : {"", "u", "unit_id,x_mm\n1,2\n", "PAR1,PAR2\n1,2\n", "PK,BZ\n1,2\n",
                           "BZh,1AY\n1,2\n", "\xef\xbb\xbfunit_id\n", "# %ECSV 1.0\nunit_id\n",
                           "SIMPLE,b\n1,2\n", "\xc3\xbf,\xc3\xbe\n1,2\n"})
    EXPECT_FALSE(ForeignFormat(text)) << text;
}

}  // namespace
}  // namespace focalfleet
