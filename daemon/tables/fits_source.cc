#include "daemon/tables/fits_source.h"

#include <fitsio.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <utility>

#include "daemon/files/fits_structure.h"
#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

constexpr LONGLONG kElementsMax = 32;  // of one row of a column of vectors

struct CloseFits {
  void operator()(fitsfile* file) const {
    int status = 0;
    fits_close_file(file, &status);
  }
};

tl::unexpected<Error> FailFits(const std::string& where, int status) {
  std::array<char, FLEN_STATUS> text{};
  fits_get_errstatus(status, text.data());
  fits_clear_errmsg();
  return Fail(ErrorCode::kInvalid, where + ": " + text.data());
}

struct Form {
  std::string name;
  std::string unit;
  int number = 0;
  int type = 0;
  LONGLONG repeat = 0;
  LONGLONG width = 0;
  [[nodiscard]] LONGLONG elements() const {
    return type == TSTRING ? (width > 0 ? repeat / width : 1) : repeat;
  }
};

/// Reads the tables of one file, one after the other.
class FitsSourceReader {
 public:
  FitsSourceReader(fitsfile* file, std::string name) : file_(file), name_(std::move(name)) {}

  Result<std::vector<SourceTable>> Tables() {
    constexpr int kUnitsMax = 1000;  // with a header; images included
    const auto of_file = Keys();
    std::vector<SourceTable> tables;
    for (int looked_at = 0; looked_at < kUnitsMax; ++looked_at) {
      int status = 0;
      int kind = 0;
      fits_movrel_hdu(file_, 1, &kind, &status);
      if (status == END_OF_FILE) break;
      if (status != 0) return FailFits(name_, status);
      if (kind != BINARY_TBL) continue;
      FOCALFLEET_TRY_ASSIGN(SourceTable table, Table());
      table.keys.insert(table.keys.end(), of_file.begin(), of_file.end());
      tables.push_back(std::move(table));
    }
    fits_clear_errmsg();
    if (tables.empty())
      return Fail(ErrorCode::kInvalid, name_ + ": there is no binary table in this FITS file");
    return tables;
  }

 private:
  /// The keys with a value, as text.
  std::vector<std::pair<std::string, std::string>> Keys() {
    std::vector<std::pair<std::string, std::string>> keys;
    int none = 0;
    int count = 0;
    fits_get_hdrspace(file_, &count, nullptr, &none);
    for (int i = 1; i <= count && none == 0; ++i) {
      int status = 0;
      std::array<char, FLEN_KEYWORD> name{};
      std::array<char, FLEN_VALUE> value{};
      std::array<char, FLEN_COMMENT> comment{};
      fits_read_keyn(file_, i, name.data(), value.data(), comment.data(), &status);
      std::string text = value.data();
      if (status != 0 || text.empty()) continue;
      if (text.front() == '\'' && text.size() >= 2) text = text.substr(1, text.rfind('\'') - 1);
      text.erase(text.find_last_not_of(' ') + 1);
      keys.emplace_back(name.data(), text);
    }
    fits_clear_errmsg();
    return keys;
  }

  Result<SourceTable> Table() {
    SourceTable table;
    table.keys = Keys();
    for (const auto& [key, value] : table.keys)
      if (key == "EXTNAME") table.name = value;
    int status = 0;
    int count = 0;
    LONGLONG row_bytes = 0;
    fits_get_num_rowsll(file_, &rows_, &status);
    fits_get_num_cols(file_, &count, &status);
    fits_read_key(file_, TLONGLONG, "NAXIS1", &row_bytes, nullptr, &status);
    if (status != 0) return FailFits(name_, status);
    if (rows_ < 0 || rows_ > kFitsRowsMax || (row_bytes == 0 && rows_ > 0))
      return Fail(ErrorCode::kInvalid, name_ + ": table '" + table.name + "' has " +
                                           std::to_string(rows_) + " rows, which cannot be");
    for (int number = 1; number <= count; ++number)
      FOCALFLEET_TRY(AddColumns(number, row_bytes, &table));
    return table;
  }

  Status AddColumns(int number, LONGLONG row_bytes, SourceTable* table) {
    int status = 0;
    Form form{.name = "", .unit = "", .number = number};
    fits_get_eqcoltypell(file_, number, &form.type, &form.repeat, &form.width, &status);
    std::array<char, FLEN_VALUE> name{};
    std::array<char, FLEN_VALUE> unit{};
    fits_get_bcolparmsll(file_, number, name.data(), unit.data(), nullptr, nullptr, nullptr,
                         nullptr, nullptr, nullptr, &status);
    form.name = name.data();
    form.unit = unit.data();
    fits_clear_errmsg();
    const LONGLONG elements = status == 0 ? form.elements() : 0;
    const bool sane = form.repeat >= 0 && form.repeat <= 8 * row_bytes;
    if (!sane || !IsRead(form.type) || elements < 1 || elements > kElementsMax ||
        table->columns.size() + static_cast<std::size_t>(elements) > limits::kCsvColumns) {
      table->passed_over.push_back(form.name);
      return {};
    }
    FOCALFLEET_TRY_ASSIGN(std::vector<FitsValues> values, Values(form, elements));
    for (std::size_t k = 0; k < values.size(); ++k)
      table->columns.push_back(
          {values.size() == 1 ? form.name : form.name + "_" + std::to_string(k), form.unit,
           std::move(values[k])});
    return {};
  }

  static bool IsRead(int type) {
    constexpr int kTypes[] = {TLOGICAL, TBYTE,  TSBYTE,    TSHORT,     TUSHORT, TINT,    TUINT,
                              TLONG,    TULONG, TLONGLONG, TULONGLONG, TFLOAT,  TDOUBLE, TSTRING};
    return std::ranges::find(kTypes, type) != std::end(kTypes);
  }

  /// The values by element. Shape: (elements), each (rows).
  Result<std::vector<FitsValues>> Values(const Form& form, LONGLONG elements) {
    switch (form.type) {
      case TSTRING:
        return Texts(form, elements);
      case TFLOAT:
      case TDOUBLE:
        return Read<double, double>(form, elements, TDOUBLE, std::nan(""));
      case TLOGICAL:
        return Read<char, std::int64_t>(form, elements, TLOGICAL, kMissingWhole);
      case TULONGLONG:
        return Unsigned(form, elements);
      default:
        return Read<LONGLONG, std::int64_t>(form, elements, TLONGLONG, kMissingWhole);
    }
  }

  template <class Raw>
  Status ReadRaw(const Form& form, int type, std::vector<Raw>* raw, std::vector<char>* missing) {
    if (raw->empty()) return {};
    int status = 0;
    int any = 0;
    fits_read_colnull(file_, type, form.number, 1, 1, static_cast<LONGLONG>(raw->size()),
                      raw->data(), missing->data(), &any, &status);
    if (status != 0) return FailFits(name_ + ": column " + form.name, status);
    return {};
  }

  template <class Raw, class Value>
  Result<std::vector<FitsValues>> Read(const Form& form, LONGLONG elements, int type,
                                       Value is_missing) {
    const auto n = static_cast<std::size_t>(elements);
    std::vector<Raw> raw(static_cast<std::size_t>(rows_) * n);
    std::vector<char> missing(raw.size());
    FOCALFLEET_TRY(ReadRaw(form, type, &raw, &missing));
    std::vector<FitsValues> values;
    for (std::size_t k = 0; k < n; ++k) {
      std::vector<Value> of_element(static_cast<std::size_t>(rows_));
      for (std::size_t row = 0; row < of_element.size(); ++row) {
        const std::size_t at = row * n + k;
        of_element[row] = missing[at] != 0 ? is_missing : static_cast<Value>(raw[at]);
      }
      values.emplace_back(std::move(of_element));
    }
    return values;
  }

  /// Numbers beyond 63 bits are kept as texts.
  Result<std::vector<FitsValues>> Unsigned(const Form& form, LONGLONG elements) {
    const auto n = static_cast<std::size_t>(elements);
    std::vector<ULONGLONG> raw(static_cast<std::size_t>(rows_) * n);
    std::vector<char> missing(raw.size());
    FOCALFLEET_TRY(ReadRaw(form, TULONGLONG, &raw, &missing));
    std::vector<FitsValues> values;
    for (std::size_t k = 0; k < n; ++k) {
      std::vector<std::string> of_element(static_cast<std::size_t>(rows_));
      for (std::size_t row = 0; row < of_element.size(); ++row)
        if (missing[row * n + k] == 0) of_element[row] = std::to_string(raw[row * n + k]);
      values.emplace_back(std::move(of_element));
    }
    return values;
  }

  Result<std::vector<FitsValues>> Texts(const Form& form, LONGLONG elements) {
    std::vector<FitsValues> values;
    std::vector<char> buffer(static_cast<std::size_t>(std::max(form.repeat, form.width)) + 1);
    for (LONGLONG k = 1; k <= elements; ++k) {
      std::vector<std::string> texts(static_cast<std::size_t>(rows_));
      for (LONGLONG row = 1; row <= rows_; ++row) {
        int status = 0;
        int none = 0;
        char* into = buffer.data();
        fits_read_col(file_, TSTRING, form.number, row, k, 1, nullptr, &into, &none, &status);
        if (status != 0) return FailFits(name_ + ": column " + form.name, status);
        std::string text = into;
        text.erase(text.find_last_not_of(' ') + 1);  // trailing blanks mean nothing in FITS
        texts[static_cast<std::size_t>(row - 1)] = std::move(text);
      }
      values.emplace_back(std::move(texts));
    }
    return values;
  }

  fitsfile* file_;
  std::string name_;
  LONGLONG rows_ = 0;
};

}  // namespace

Result<SourceFile> ReadFitsSource(std::string bytes, const std::string& name) {
  FOCALFLEET_TRY(CheckFitsStructure(bytes, name));
  int status = 0;
  fitsfile* opened = nullptr;
  void* begin = bytes.data();
  std::size_t size = bytes.size();
  // The name is a constant: cfitsio would interpret a name from outside as an extended file name.
  if (fits_open_memfile(&opened, "table.fits", READONLY, &begin, &size, 0, nullptr, &status) != 0)
    return FailFits(name, status);
  const std::unique_ptr<fitsfile, CloseFits> file(opened);
  FOCALFLEET_TRY_ASSIGN(std::vector<SourceTable> tables, FitsSourceReader(opened, name).Tables());
  return SourceFile{.format = "a FITS file", .tables = std::move(tables)};
}

}  // namespace focalfleet
