#include "daemon/files/fits_table.h"

#include <fitsio.h>
#include <strings.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>

#include "daemon/files/fits_structure.h"
#include "daemon/files/text_file.h"

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
  }  // the stack of messages is cfitsio's own state, so it is left empty
  return all;
}

tl::unexpected<Error> Broken(const std::string& path, int status, ErrorCode code) {
  return Fail(code, path + ": " + Reason(status));
}

bool SameName(std::string_view a, std::string_view b) {
  return a.size() == b.size() && ::strncasecmp(a.data(), b.data(), a.size()) == 0;
}

struct ColumnForm {
  std::string where;  // name that messages show
  int number = 0;
  int type = 0;
  LONGLONG repeat = 0;
  LONGLONG width = 0;
};

/// True if a row of the column has a single number, or a text.
bool IsPlain(const ColumnForm& form) {
  constexpr int kNumbers[] = {TBYTE, TSBYTE, TSHORT,    TUSHORT,    TINT,   TUINT,
                              TLONG, TULONG, TLONGLONG, TULONGLONG, TFLOAT, TDOUBLE};
  if (form.type == TSTRING) return true;
  return form.repeat == 1 && std::ranges::find(kNumbers, form.type) != std::end(kNumbers);
}

/// A table that is being read.
class TableReader {
 public:
  TableReader(fitsfile* file, const std::string& name) : file_(file), name_(name) {}

  /// Moves to the next binary table, beginning with the first. False: there is none.
  /// Errors: kInvalid.
  Result<bool> Next() {
    constexpr int kTablesMax = 1000;  // HDUs, images included; a header is 2880 bytes at least
    for (int kind = 0; ++looked_at_ < kTablesMax;) {
      int status = 0;
      fits_movrel_hdu(file_, 1, &kind, &status);
      if (status == END_OF_FILE) return false;
      if (status != 0) return Broken(name_, status, ErrorCode::kInvalid);
      if (kind == BINARY_TBL) return true;
    }
    return false;
  }

  /// The names in `columns` that the table lacks.
  [[nodiscard]] std::vector<std::string> Lacking(const std::vector<std::string>& columns) const {
    std::vector<std::string> lacking;
    for (const std::string& column : columns)
      if (NumberOf(column) == 0) lacking.push_back(column);
    return lacking;
  }

  [[nodiscard]] std::string TableName() const {
    std::array<char, FLEN_VALUE> name{};
    int unnamed = 0;
    fits_read_key(file_, TSTRING, "EXTNAME", name.data(), nullptr, &unnamed);
    fits_clear_errmsg();
    return unnamed == 0 ? name.data() : "";
  }

  Result<std::vector<FitsColumn>> Columns(const FitsWanted& wanted) {
    int status = 0;
    LONGLONG row_bytes = 0;
    int count = 0;
    fits_get_num_rowsll(file_, &rows_, &status);
    fits_get_num_cols(file_, &count, &status);
    fits_read_key(file_, TLONGLONG, "NAXIS1", &row_bytes, nullptr, &status);
    if (status != 0) return Broken(name_, status, ErrorCode::kInvalid);
    if (rows_ < 0 || rows_ > wanted.rows_max)
      return Fail(ErrorCode::kInvalid, name_ + ": " + std::to_string(rows_) +
                                           " rows are more than " +
                                           std::to_string(wanted.rows_max));
    // Rows with bytes are all in the file. Rows without bytes could be as many as the header
    // states, so they are refused.
    if (row_bytes == 0 && rows_ > 0)
      return Fail(ErrorCode::kInvalid, name_ + ": rows without a byte");
    row_bytes_ = row_bytes;
    std::vector<FitsColumn> columns;
    const bool all = wanted.columns.empty();
    std::vector<std::string> names = wanted.columns;
    names.insert(names.end(), wanted.optional.begin(), wanted.optional.end());
    if (all)
      for (int number = 1; number <= count; ++number) {
        FOCALFLEET_TRY(AddColumn(number, /*must_be_plain=*/false, &columns));
      }
    for (const std::string& name : names) {
      if (NumberOf(name) < 0)
        return Fail(ErrorCode::kInvalid, name_ + ": column " + name + " is there twice");
      if (NumberOf(name) > 0)
        FOCALFLEET_TRY(AddColumn(NumberOf(name), /*must_be_plain=*/true, &columns));
    }
    return columns;
  }

 private:
  /// The number of the column; 0: none; -1: more than one.
  [[nodiscard]] int NumberOf(const std::string& column) const {
    int status = 0;
    int number = 0;
    fits_get_colnum(file_, CASEINSEN, const_cast<char*>(column.c_str()), &number, &status);
    fits_clear_errmsg();
    if (status == COL_NOT_UNIQUE) return -1;
    return status == 0 ? number : 0;
  }

  Status AddColumn(int number, bool must_be_plain, std::vector<FitsColumn>* columns) {
    int status = 0;
    ColumnForm form{.number = number};
    fits_get_eqcoltypell(file_, number, &form.type, &form.repeat, &form.width, &status);
    std::array<char, FLEN_VALUE> name{};
    std::array<char, FLEN_VALUE> unit{};
    fits_get_bcolparmsll(file_, number, name.data(), unit.data(), nullptr, nullptr, nullptr,
                         nullptr, nullptr, nullptr, &status);
    FitsColumn column{.name = name.data(), .unit = unit.data(), .values = {}};
    form.where = name_ + ": column " + column.name;
    if (status != 0) return Broken(form.where, status, ErrorCode::kInvalid);
    if (!IsPlain(form) || form.repeat < 0 || form.repeat > row_bytes_) {
      if (!must_be_plain) return {};
      return Fail(ErrorCode::kInvalid, form.where + " has not one number a row");
    }
    FOCALFLEET_TRY_ASSIGN(column.values, form.type == TSTRING ? Texts(form) : Numbers(form));
    columns->push_back(std::move(column));
    return {};
  }

  Result<FitsValues> Texts(const ColumnForm& form) {
    int status = 0;
    std::vector<std::string> texts(static_cast<std::size_t>(rows_));
    std::vector<char> buffer(static_cast<std::size_t>(form.repeat) + 1);
    for (LONGLONG row = 1; row <= rows_ && status == 0; ++row) {
      char* into = buffer.data();
      int none = 0;
      fits_read_col(file_, TSTRING, form.number, row, 1, 1, nullptr, &into, &none, &status);
      std::string text = into;
      text.erase(text.find_last_not_of(' ') + 1);  // trailing blanks mean nothing in FITS
      texts[static_cast<std::size_t>(row - 1)] = std::move(text);
    }
    if (status != 0) return Broken(form.where, status, ErrorCode::kInvalid);
    return FitsValues(std::move(texts));
  }

  Result<FitsValues> Numbers(const ColumnForm& form) {
    int status = 0;
    int any_missing = 0;
    if (form.type == TFLOAT || form.type == TDOUBLE) {
      std::vector<double> numbers(static_cast<std::size_t>(rows_));
      double missing = std::nan("");
      fits_read_col(file_, TDOUBLE, form.number, 1, 1, rows_, &missing, numbers.data(),
                    &any_missing, &status);
      if (status != 0) return Broken(form.where, status, ErrorCode::kInvalid);
      return FitsValues(std::move(numbers));
    }
    std::vector<std::int64_t> numbers(static_cast<std::size_t>(rows_));
    LONGLONG missing = INT64_MIN;
    fits_read_col(file_, TLONGLONG, form.number, 1, 1, rows_, &missing, numbers.data(),
                  &any_missing, &status);
    if (status != 0) return Broken(form.where, status, ErrorCode::kInvalid);
    if (any_missing != 0) {
      const auto row = std::ranges::find(numbers, INT64_MIN) - numbers.begin() + 1;
      return Fail(ErrorCode::kInvalid,
                  form.where + ": the value is missing in row " + std::to_string(row));
    }
    return FitsValues(std::move(numbers));
  }

  fitsfile* file_;
  const std::string& name_;
  LONGLONG rows_ = 0;
  LONGLONG row_bytes_ = 0;
  int looked_at_ = 0;
};

/// Keys that describe the table or image; writing a table makes them anew.
bool IsOfTheFormat(std::string_view key) {
  for (const char* stem :
       {"XTENSION", "SIMPLE", "BITPIX", "NAXIS",  "PCOUNT", "GCOUNT",   "EXTEND",
        "TFIELDS",  "TTYPE",  "TFORM",  "TUNIT",  "TDISP",  "TNULL",    "TSCAL",
        "TZERO",    "TDIM",   "THEAP",  "BSCALE", "BZERO",  "CHECKSUM", "DATASUM"})
    if (key.starts_with(stem)) return true;
  return key == "EXTNAME";
}

/// A number as the header has it. Empty: a logical value, a complex number, or no value.
std::optional<FitsKey> NumberKey(const char* name, std::string_view text, const char* comment) {
  if (text.starts_with('+')) text.remove_prefix(1);
  const char* end = text.data() + text.size();
  std::int64_t whole = 0;
  if (const auto read = std::from_chars(text.data(), end, whole);
      read.ec == std::errc() && read.ptr == end && !text.empty())
    return FitsKey{name, whole, comment};
  double number = 0;
  if (const auto read = std::from_chars(text.data(), end, number);
      read.ec == std::errc() && read.ptr == end && !text.empty())
    return FitsKey{name, number, comment};
  return std::nullopt;
}

/// Adds the keys of the current header, except those that the table has already. A broken key is
/// skipped: it may not be needed.
void AddKeys(fitsfile* file, FitsTable* table) {
  int none = 0;
  int count = 0;
  fits_get_hdrspace(file, &count, nullptr, &none);
  for (int i = 1; i <= count && none == 0; ++i) {
    int status = 0;
    std::array<char, FLEN_KEYWORD> name{};
    std::array<char, FLEN_VALUE> value{};
    std::array<char, FLEN_COMMENT> comment{};
    fits_read_keyn(file, i, name.data(), value.data(), comment.data(), &status);
    if (status != 0 || IsOfTheFormat(name.data()) || table->FindKey(name.data()) != nullptr)
      continue;
    if (value[0] != '\'') {
      if (auto key = NumberKey(name.data(), value.data(), comment.data()))
        table->keys.push_back(std::move(*key));
      continue;
    }
    char* text = nullptr;
    if (fits_read_key_longstr(file, name.data(), &text, nullptr, &status) != 0) continue;
    table->keys.push_back({name.data(), std::string(text), comment.data()});
    fits_free_memory(text, &status);
  }
  fits_clear_errmsg();
}

std::string FormOf(const FitsColumn& column) {
  const std::string repeat = std::to_string(column.elements);
  if (std::holds_alternative<std::vector<double>>(column.values)) return repeat + "D";
  if (std::holds_alternative<std::vector<std::int64_t>>(column.values)) return repeat + "K";
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
  return columns.empty() ? 0
                         : std::visit([](const auto& values) { return values.size(); },
                                      columns.front().values) /
                               columns.front().elements;
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

Result<FitsTable> ParseFitsTable(std::string bytes, const std::string& name,
                                 const FitsWanted& wanted) {
  FOCALFLEET_TRY(CheckFitsStructure(bytes, name));
  int status = 0;
  fitsfile* opened = nullptr;
  // cfitsio reads whole blocks, also from memory that ends within one.
  bytes.resize((bytes.size() + kFitsBlockBytes - 1) / kFitsBlockBytes * kFitsBlockBytes);
  void* begin = bytes.data();
  std::size_t size = bytes.size();
  // The name is a constant: cfitsio would interpret a name from outside as an extended file name.
  if (fits_open_memfile(&opened, "table.fits", READONLY, &begin, &size, 0, nullptr, &status) != 0)
    return Broken(name, status, ErrorCode::kInvalid);
  const File file(opened);
  TableReader reader(opened, name);
  std::string lacks;
  for (;;) {
    FOCALFLEET_TRY_ASSIGN(const bool there, reader.Next());
    if (!there)
      return Fail(ErrorCode::kInvalid,
                  name + (lacks.empty() ? ": there is no binary table in it" : lacks));
    const std::vector<std::string> lacking = reader.Lacking(wanted.columns);
    if (lacking.empty()) break;
    if (!lacks.empty()) continue;
    lacks = ": no table has what is wanted; the first, '" + reader.TableName() + "', lacks column";
    for (const std::string& column : lacking) lacks += " " + column;
  }
  FitsTable table;
  table.name = reader.TableName();
  FOCALFLEET_TRY_ASSIGN(table.columns, reader.Columns(wanted));
  AddKeys(opened, &table);
  int kind = 0;
  if (fits_movabs_hdu(opened, 1, &kind, &status) == 0) AddKeys(opened, &table);
  return table;
}

Result<FitsTable> ReadFitsTable(const std::string& path, const FitsWanted& wanted) {
  FOCALFLEET_TRY_ASSIGN(std::string bytes, ReadFile(path));
  return ParseFitsTable(std::move(bytes), path, wanted);
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
