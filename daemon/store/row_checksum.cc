#include "daemon/store/row_checksum.h"

#include <zlib.h>

#include <array>
#include <cstdint>
#include <cstring>
#include <string>

namespace focalfleet::store_internal {
namespace {

/// CRC-32 of all values, one after the other: type, length and bytes, so that no two lists of
/// values have the same bytes.
class Sum {
 public:
  void Add(sqlite3_value* value) {
    const int type = sqlite3_value_type(value);
    std::uint64_t bits = 0;
    if (type == SQLITE_INTEGER) {
      bits = static_cast<std::uint64_t>(sqlite3_value_int64(value));
    } else if (type == SQLITE_FLOAT) {
      // SQLite stores -0.0 as 0, and returns it without the sign.
      const double real = sqlite3_value_double(value) + 0.0;
      std::memcpy(&bits, &real, sizeof bits);
    } else if (type != SQLITE_NULL) {
      const void* const bytes = sqlite3_value_blob(value);
      const int length = sqlite3_value_bytes(value);
      Take(type, static_cast<std::uint64_t>(length));
      if (length > 0)
        crc_ = ::crc32(crc_, static_cast<const Bytef*>(bytes), static_cast<uInt>(length));
      return;
    }
    Take(type, bits);
  }
  [[nodiscard]] sqlite3_int64 value() const { return static_cast<sqlite3_int64>(crc_); }

 private:
  void Take(int type, std::uint64_t bits) {
    std::array<Bytef, 9> bytes{static_cast<Bytef>(type)};
    for (std::size_t k = 0; k < 8; ++k) bytes[1 + k] = static_cast<Bytef>(bits >> (8 * k));
    crc_ = ::crc32(crc_, bytes.data(), static_cast<uInt>(bytes.size()));
  }
  uLong crc_ = 0;
};

void RowChecksum(sqlite3_context* context, int count, sqlite3_value** values) {
  Sum sum;
  for (int k = 0; k < count; ++k) sum.Add(values[k]);
  sqlite3_result_int64(context, sum.value());
}

}  // namespace

Status AddRowChecksum(sqlite3* db) {
  constexpr int kFlags = SQLITE_UTF8 | SQLITE_DETERMINISTIC | SQLITE_DIRECTONLY;
  const int code = sqlite3_create_function_v2(db, "row_checksum", -1, kFlags, nullptr, RowChecksum,
                                              nullptr, nullptr, nullptr);
  if (code == SQLITE_OK) return {};
  return Fail(ErrorCode::kUnavailable, std::string("no checksum of rows: ") + sqlite3_errstr(code));
}

}  // namespace focalfleet::store_internal
