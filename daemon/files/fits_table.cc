#include "daemon/files/fits_table.h"

#include <fitsio.h>
#include <strings.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <memory>
#include <utility>

namespace focalfleet {
namespace {

struct Close {
  void operator()(fitsfile* file) const {
    int status = 0;
    fits_close_file(file, &status);
  }
};
using File = std::unique_ptr<fitsfile, Close>;

std::string Reason(int status) {
  std::array<char, FLEN_STATUS> text{};
  fits_get_errstatus(status, text.data());
  std::array<char, FLEN_ERRMSG> detail{};
  std::string all = text.data();
  while (fits_read_errmsg(detail.data()) != 0) {
  }  // the stack of messages is cfitsio's own state: left empty
  return all;
}

tl::unexpected<Error> Broken(const std::string& path, int status, ErrorCode code) {
  return Fail(code, path + ": " + Reason(status));
}

bool SameName(std::string_view a, std::string_view b) {
  return a.size() == b.size() && ::strncasecmp(a.data(), b.data(), a.size()) == 0;
}

struct ColumnForm {
  int type = 0;
  long repeat = 0;
  long width = 0;
};

Result<FitsColumn> ReadColumn(fitsfile* file, int number, const ColumnForm& form, long rows,
                              const std::string& path) {
  int status = 0;
  FitsColumn column;
  std::array<char, FLEN_VALUE> name{};
  std::array<char, FLEN_VALUE> unit{};
  fits_get_bcolparms(file, number, name.data(), unit.data(), nullptr, nullptr, nullptr, nullptr,
                     nullptr, nullptr, &status);
  column.name = name.data();
  column.unit = unit.data();
  const auto count = static_cast<std::size_t>(rows);
  if (form.type == TSTRING) {
    std::vector<std::string> texts(count);
    std::vector<char> buffer(static_cast<std::size_t>(form.repeat) + 1);
    for (long row = 1; row <= rows && status == 0; ++row) {
      char* into = buffer.data();
      int none = 0;
      fits_read_col(file, TSTRING, number, row, 1, 1, nullptr, &into, &none, &status);
      std::string text = into;
      text.erase(text.find_last_not_of(' ') + 1);  // blanks at the end mean nothing in FITS
      texts[static_cast<std::size_t>(row - 1)] = std::move(text);
    }
    column.values = std::move(texts);
  } else if (form.type == TFLOAT || form.type == TDOUBLE) {
    std::vector<double> numbers(count);
    double missing = std::nan("");
    int any_missing = 0;
    fits_read_col(file, TDOUBLE, number, 1, 1, rows, &missing, numbers.data(), &any_missing,
                  &status);
    column.values = std::move(numbers);
  } else {
    std::vector<std::int64_t> numbers(count);
    int any_missing = 0;
    LONGLONG missing = INT64_MIN;
    fits_read_col(file, TLONGLONG, number, 1, 1, rows, &missing, numbers.data(), &any_missing,
                  &status);
    if (any_missing != 0)
      return Fail(ErrorCode::kInvalid, path + ": column " + column.name + " has missing values");
    column.values = std::move(numbers);
  }
  if (status != 0) return Broken(path, status, ErrorCode::kInvalid);
  return column;
}

/// Keys that describe the table itself; writing it makes them anew.
bool IsOfTheFormat(std::string_view key) {
  for (const char* stem : {"XTENSION", "TTYPE", "TFORM", "TUNIT", "TDISP", "CHECKSUM", "DATASUM"})
    if (key.starts_with(stem)) return true;
  return key == "EXTNAME";
}

void ReadKeys(fitsfile* file, FitsTable* table) {
  int status = 0;
  int count = 0;
  fits_get_hdrspace(file, &count, nullptr, &status);
  for (int i = 1; i <= count && status == 0; ++i) {
    std::array<char, FLEN_KEYWORD> name{};
    std::array<char, FLEN_VALUE> value{};
    std::array<char, FLEN_COMMENT> comment{};
    fits_read_keyn(file, i, name.data(), value.data(), comment.data(), &status);
    if (status != 0 || value[0] != '\'') continue;
    if (IsOfTheFormat(name.data())) continue;
    char* text = nullptr;
    if (fits_read_key_longstr(file, name.data(), &text, nullptr, &status) != 0) continue;
    table->keys.push_back({name.data(), std::string(text), comment.data()});
    fits_free_memory(text, &status);
  }
}

std::string FormOf(const FitsColumn& column) {
  if (std::holds_alternative<std::vector<double>>(column.values)) return "1D";
  if (std::holds_alternative<std::vector<std::int64_t>>(column.values)) return "1K";
  std::size_t width = 1;
  for (const std::string& text : std::get<std::vector<std::string>>(column.values))
    width = std::max(width, text.size());
  return std::to_string(width) + "A";
}

void WriteColumn(fitsfile* file, int number, const FitsColumn& column, int* status) {
  if (const auto* numbers = std::get_if<std::vector<double>>(&column.values)) {
    fits_write_col(file, TDOUBLE, number, 1, 1, static_cast<LONGLONG>(numbers->size()),
                   const_cast<double*>(numbers->data()), status);
  } else if (const auto* whole = std::get_if<std::vector<std::int64_t>>(&column.values)) {
    fits_write_col(file, TLONGLONG, number, 1, 1, static_cast<LONGLONG>(whole->size()),
                   const_cast<std::int64_t*>(whole->data()), status);
  } else {
    const auto& texts = std::get<std::vector<std::string>>(column.values);
    for (std::size_t row = 0; row < texts.size() && *status == 0; ++row) {
      char* text = const_cast<char*>(texts[row].c_str());
      fits_write_col(file, TSTRING, number, static_cast<LONGLONG>(row) + 1, 1, 1, &text, status);
    }
  }
}

void WriteKey(fitsfile* file, const FitsKey& key, int* status) {
  if (const auto* whole = std::get_if<std::int64_t>(&key.value)) {
    LONGLONG value = *whole;
    fits_write_key(file, TLONGLONG, key.name.c_str(), &value, key.comment.c_str(), status);
  } else if (const auto* number = std::get_if<double>(&key.value)) {
    double value = *number;
    fits_write_key(file, TDOUBLE, key.name.c_str(), &value, key.comment.c_str(), status);
  } else {
    const auto& text = std::get<std::string>(key.value);
    fits_write_key_longstr(file, key.name.c_str(), text.c_str(), key.comment.c_str(), status);
  }
}

}  // namespace

std::size_t FitsTable::rows() const {
  return columns.empty()
             ? 0
             : std::visit([](const auto& values) { return values.size(); }, columns.front().values);
}

const FitsColumn* FitsTable::Find(std::string_view column) const {
  const auto found = std::ranges::find_if(
      columns, [&](const FitsColumn& candidate) { return SameName(candidate.name, column); });
  return found == columns.end() ? nullptr : &*found;
}

const FitsKey* FitsTable::FindKey(std::string_view key) const {
  const auto found = std::ranges::find_if(
      keys, [&](const FitsKey& candidate) { return SameName(candidate.name, key); });
  return found == keys.end() ? nullptr : &*found;
}

Result<FitsTable> ReadFitsTable(const std::string& path) {
  int status = 0;
  fitsfile* opened = nullptr;
  if (fits_open_diskfile(&opened, path.c_str(), READONLY, &status) != 0)
    return Broken(path, status,
                  status == FILE_NOT_OPENED ? ErrorCode::kUnavailable : ErrorCode::kInvalid);
  const File file(opened);
  int kind = 0;
  while (status == 0 && kind != BINARY_TBL) fits_movrel_hdu(opened, 1, &kind, &status);
  if (status == END_OF_FILE)
    return Fail(ErrorCode::kInvalid, path + ": there is no binary table in it");
  long rows = 0;
  int columns = 0;
  fits_get_num_rows(opened, &rows, &status);
  fits_get_num_cols(opened, &columns, &status);
  if (status != 0) return Broken(path, status, ErrorCode::kInvalid);
  if (rows > kFitsRowsMax)
    return Fail(ErrorCode::kInvalid, path + ": " + std::to_string(rows) + " rows are too many");
  FitsTable table;
  std::array<char, FLEN_VALUE> name{};
  int unnamed = 0;
  if (fits_read_key(opened, TSTRING, "EXTNAME", name.data(), nullptr, &unnamed) == 0)
    table.name = name.data();
  ReadKeys(opened, &table);
  for (int number = 1; number <= columns; ++number) {
    ColumnForm form;
    fits_get_eqcoltype(opened, number, &form.type, &form.repeat, &form.width, &status);
    if (status != 0) return Broken(path, status, ErrorCode::kInvalid);
    if (form.type < 0 || (form.type != TSTRING && form.repeat != 1)) continue;
    FOCALFLEET_TRY_ASSIGN(FitsColumn column, ReadColumn(opened, number, form, rows, path));
    table.columns.push_back(std::move(column));
  }
  return table;
}

Status WriteFitsTable(const std::string& path, const FitsTable& table) {
  const std::string part = path + ".part";
  ::unlink(part.c_str());
  int status = 0;
  fitsfile* file = nullptr;
  if (fits_create_diskfile(&file, part.c_str(), &status) != 0)
    return Broken(path, status, ErrorCode::kUnavailable);
  std::vector<std::string> forms;
  std::vector<char*> names;
  std::vector<char*> form_texts;
  std::vector<char*> units;
  for (const FitsColumn& column : table.columns) forms.push_back(FormOf(column));
  for (std::size_t c = 0; c < table.columns.size(); ++c) {
    names.push_back(const_cast<char*>(table.columns[c].name.c_str()));
    form_texts.push_back(const_cast<char*>(forms[c].c_str()));
    units.push_back(const_cast<char*>(table.columns[c].unit.c_str()));
  }
  fits_create_tbl(file, BINARY_TBL, static_cast<LONGLONG>(table.rows()),
                  static_cast<int>(names.size()), names.data(), form_texts.data(), units.data(),
                  table.name.c_str(), &status);
  for (const FitsKey& key : table.keys) WriteKey(file, key, &status);
  for (std::size_t c = 0; c < table.columns.size() && status == 0; ++c)
    WriteColumn(file, static_cast<int>(c) + 1, table.columns[c], &status);
  fits_write_chksum(file, &status);
  int closed = 0;
  fits_close_file(file, &closed);
  if (status == 0) status = closed;
  if (status == 0 && std::rename(part.c_str(), path.c_str()) == 0) return {};
  ::unlink(part.c_str());
  return status != 0 ? Broken(path, status, ErrorCode::kUnavailable)
                     : Fail(ErrorCode::kUnavailable, path + ": cannot be replaced");
}

}  // namespace focalfleet
