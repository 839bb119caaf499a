#include "daemon/tables/read_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <optional>

#include "daemon/files/gunzip.h"
#include "daemon/files/text_file.h"
#include "daemon/tables/fits_source.h"
#include "daemon/tables/json_source.h"
#include "daemon/tables/xml_source.h"
#include "daemon/tables/yanny_source.h"

namespace focalfleet {
namespace {

bool SameLetters(std::string_view a, std::string_view b) {
  const auto small = [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; };
  return std::ranges::equal(a, b, [&](char x, char y) { return small(x) == small(y); });
}

char FirstLetter(std::string_view text) {
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  const std::size_t at = text.find_first_not_of(" \t\r\n");
  return at == std::string_view::npos ? '\0' : text[at];
}

std::string_view WithoutMark(std::string_view text) {
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  return text;
}

/// XML and JSON become trees, which take many times the file's size.
Status CheckTreeSize(std::string_view bytes, const std::string& path) {
  constexpr std::size_t kBytesMax = std::size_t{256} << 20;
  if (bytes.size() <= kBytesMax) return {};
  return Fail(ErrorCode::kInvalid, fmt::format("{}: larger than {} MiB: write it as CSV or FITS",
                                               path, kBytesMax >> 20));
}

/// The tables of a file that is not text in lines; none: it is.
Result<std::optional<SourceFile>> SourceOfBytes(std::string* bytes, const std::string& path) {
  if (bytes->starts_with("SIMPLE  =")) {
    FOCALFLEET_TRY_ASSIGN(SourceFile file, ReadFitsSource(std::move(*bytes), path));
    return std::optional(std::move(file));
  }
  const char first = FirstLetter(*bytes);
  if (first == '<') {  // in the encoding that it states
    FOCALFLEET_TRY(CheckTreeSize(*bytes, path));
    FOCALFLEET_TRY_ASSIGN(SourceFile file, ReadXmlSource(*bytes, path));
    return std::optional(std::move(file));
  }
  FOCALFLEET_TRY(CheckText(*bytes, path));
  if (IsYanny(WithoutMark(*bytes))) {
    FOCALFLEET_TRY_ASSIGN(SourceFile file, ReadYannySource(WithoutMark(*bytes), path));
    return std::optional(std::move(file));
  }
  if (first == '{' || first == '[') {
    FOCALFLEET_TRY(CheckTreeSize(*bytes, path));
    FOCALFLEET_TRY_ASSIGN(SourceFile file, ReadJsonSource(WithoutMark(*bytes), path));
    return std::optional(std::move(file));
  }
  return std::optional<SourceFile>();
}

Result<std::string> Unpacked(std::string bytes, const std::string& path) {
  if (!IsGzip(bytes)) return bytes;
  return Gunzip(bytes, path, kFileBytesMax);
}

/// The place of the first table with that column, else 0.
std::size_t Chosen(const std::vector<SourceTable>& tables, std::string_view key_column) {
  const auto found = std::ranges::find_if(tables, [&](const SourceTable& table) {
    return std::ranges::any_of(table.columns, [&](const FitsColumn& column) {
      return SameLetters(column.name, key_column);
    });
  });
  return found == tables.end() ? 0 : static_cast<std::size_t>(found - tables.begin());
}

}  // namespace

Result<TableText> TableTextOf(std::string bytes, const std::string& path,
                              std::string_view key_column) {
  const bool packed = IsGzip(bytes);
  FOCALFLEET_TRY_ASSIGN(bytes, Unpacked(std::move(bytes), path));
  FOCALFLEET_TRY_ASSIGN(const std::optional<SourceFile> source, SourceOfBytes(&bytes, path));
  const char* gzip = packed ? ", compressed with gzip" : "";
  if (!source)
    return TableText{.text = std::move(bytes),
                     .note = packed ? fmt::format("{}: text{}", path, gzip) : ""};
  const std::size_t chosen = Chosen(source->tables, key_column);
  const SourceTable& table = source->tables[chosen];
  std::string note = fmt::format("{}: {}{}, {} rows", path, source->format, gzip, table.rows());
  if (source->tables.size() > 1)
    note += fmt::format("; table {} of {}{}", chosen + 1, source->tables.size(),
                        table.name.empty() ? "" : " (" + table.name + ")");
  if (!table.passed_over.empty())
    note += fmt::format("; columns without single values passed over: {}",
                        fmt::join(table.passed_over, ", "));
  return TableText{.text = TextOf(table), .note = std::move(note)};
}

Result<TableText> ReadTableText(const std::string& path, std::string_view key_column) {
  FOCALFLEET_TRY_ASSIGN(std::string bytes, ReadFile(path));
  return TableTextOf(std::move(bytes), path, key_column);
}

Result<std::string> ReadTableAsText(const std::string& path, std::string_view key_column) {
  FOCALFLEET_TRY_ASSIGN(TableText table, ReadTableText(path, key_column));
  return std::move(table.text);
}

std::string NamedTable::Key(std::string_view wanted) const {
  for (const auto& [key, value] : keys)
    if (SameLetters(key, wanted)) return value;
  return {};
}

Result<std::vector<NamedTable>> ReadTables(const std::string& path) {
  FOCALFLEET_TRY_ASSIGN(std::string bytes, ReadFile(path));
  FOCALFLEET_TRY_ASSIGN(bytes, Unpacked(std::move(bytes), path));
  FOCALFLEET_TRY_ASSIGN(const std::optional<SourceFile> source, SourceOfBytes(&bytes, path));
  std::vector<NamedTable> tables;
  if (!source) {
    FOCALFLEET_TRY_ASSIGN(CsvTable table, CsvTable::Parse(bytes, path));
    tables.push_back({"", {}, std::move(table)});
    return tables;
  }
  for (const SourceTable& each : source->tables) {
    if (each.columns.empty()) continue;
    FOCALFLEET_TRY_ASSIGN(CsvTable table, CsvTable::Parse(TextOf(each), path));
    tables.push_back({each.name, each.keys, std::move(table)});
  }
  if (tables.empty()) return Fail(ErrorCode::kInvalid, path + ": no table with columns in it");
  return tables;
}

std::string FindTable(const std::string& folder, const std::string& stem) {
  const std::filesystem::path path(folder);
  constexpr std::string_view kExtensions[] = {".csv",  ".ecsv",    ".fits", ".csv.gz", ".fits.gz",
                                              ".json", ".ecsv.gz", ".par",  ".xml",    ".vot"};
  for (const std::string_view extension : kExtensions) {
    const std::filesystem::path file = path / (stem + std::string(extension));
    std::error_code none;
    if (std::filesystem::exists(file, none)) return file;
  }
  return path / (stem + ".csv");
}

}  // namespace focalfleet
