#include "fleet/files/foreign_format.h"

namespace focalfleet {
namespace {

using namespace std::string_view_literals;

struct Format {
  std::string_view magic;
  std::size_t at;
  const char* reported;
};

constexpr const char* kGzip = "compressed with gzip: unpack it first (gunzip)";
constexpr const char* kBzip2 = "compressed with bzip2: unpack it first (bunzip2)";
constexpr const char* kUtf16 = "text in UTF-16: save it as UTF-8 (iconv -f UTF-16 -t UTF-8)";
constexpr const char* kHdf5 =
    "an HDF5 file: write its table as CSV (pandas: read_hdf(...).to_csv('t.csv', index=False))";

// The first row that fits decides.
constexpr Format kFormats[] = {
    {"SIMPLE  ="sv, 0,
     "a FITS file: write its table as CSV (astropy: Table.read('t.fits').write('t.csv'))"},
    {"\x1f\x8b"sv, 0, kGzip},
    {"\x1f\x9d"sv, 0, "compressed with compress: unpack it first (uncompress)"},
    {"1AY&SY"sv, 4, kBzip2},
    {"\x17\x72\x45\x38\x50\x90"sv, 4, kBzip2},
    {"\xfd\x37zXZ\0"sv, 0, "compressed with xz: unpack it first (unxz)"},
    {"\x28\xb5\x2f\xfd"sv, 0, "compressed with zstd: unpack it first (unzstd)"},
    {"\x04\x22\x4d\x18"sv, 0, "compressed with lz4: unpack it first (unlz4)"},
    {"7z\xbc\xaf\x27\x1c"sv, 0, "a 7z archive: unpack it first"},
    {"ustar"sv, 257, "a tar archive: unpack it first (tar -xf)"},
    {"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"sv, 0, "an Excel workbook: save the sheet as CSV (UTF-8)"},
    {"\x89HDF\r\n\x1a\n"sv, 0, kHdf5},
    {"\x89HDF\r\n\x1a\n"sv, 512, kHdf5},
    {"SQLite format 3\0"sv, 0,
     "an SQLite database: write its table as CSV (sqlite3 -header -csv FILE 'SELECT ...')"},
    {"ARROW1\0"sv, 0,
     "a Feather file: write its table as CSV (pandas: read_feather(...).to_csv('t.csv', "
     "index=False))"},
    {"\x93NUMPY"sv, 0, "a NumPy array: write it as CSV with the columns' names in the first line"},
    {"%PDF-"sv, 0, "a PDF document, no table"},
    {"\xff\xfe\0\0"sv, 0, "text in UTF-32: save it as UTF-8 (iconv -f UTF-32 -t UTF-8)"},
    {"\0\0\xfe\xff"sv, 0, "text in UTF-32: save it as UTF-8 (iconv -f UTF-32 -t UTF-8)"},
    {"\xff\xfe"sv, 0, kUtf16},
    {"\xfe\xff"sv, 0, kUtf16},
};

bool Stands(std::string_view magic, std::string_view bytes, std::size_t at) {
  return bytes.size() >= at + magic.size() && bytes.substr(at, magic.size()) == magic;
}

/// The message for a ZIP archive, by its content.
std::string ZipText(std::string_view head) {
  const auto holds = [&](std::string_view name) {
    return head.find(name) != std::string_view::npos;
  };
  if (holds("[Content_Types].xml") || holds("xl/") || holds("application/vnd.oasis"))
    return "a spreadsheet (.xlsx, .ods): save the sheet as CSV (UTF-8)";
  if (holds(".npy")) return "arrays of NumPy (.npz): write them as CSV with the columns' names";
  return "a ZIP archive, or a spreadsheet: unpack it first, or save the sheet as CSV (UTF-8)";
}

/// Without the mark at the beginning every other byte of plain words is 0.
bool LooksLikeUtf16(std::string_view head) {
  constexpr std::size_t kLetters = 4;
  if (head.size() < 2 * kLetters) return false;
  for (const std::size_t zero : {std::size_t{0}, std::size_t{1}}) {
    bool fits = true;
    for (std::size_t k = 0; k < kLetters; ++k)
      fits &= head[2 * k + zero] == 0 && head[2 * k + 1 - zero] != 0;
    if (fits) return true;
  }
  return false;
}

}  // namespace

std::optional<std::string> ForeignFormat(std::string_view bytes) {
  const std::string_view head = bytes.substr(0, 1024);
  for (const Format& format : kFormats)
    if (Stands(format.magic, head, format.at)) return format.reported;
  if (Stands("PK\x03\x04"sv, head, 0) || Stands("PK\x05\x06"sv, head, 0)) return ZipText(head);
  // The word alone might be a column's name.
  if (Stands("PAR1"sv, head, 0) && bytes.size() > 8 && bytes.ends_with("PAR1"))
    return "a Parquet file: write its table as CSV (pandas: read_parquet(...).to_csv('t.csv', "
           "index=False))";
  if (LooksLikeUtf16(head)) return kUtf16;
  return std::nullopt;
}

}  // namespace focalfleet
