#include "daemon/store/log_rewrite.h"

#include <algorithm>
#include <vector>

namespace focalfleet::store_internal {

Status RewriteLog(Connection& connection) {
  const auto failed = [&](int code) -> Status {
    return tl::unexpected<Error>(connection.Named(
        {CodeOf(code),
         std::string("the write-ahead log cannot be made durable: ") + sqlite3_errstr(code)}));
  };
  sqlite3_file* log = nullptr;
  sqlite3_file_control(connection.db(), "main", SQLITE_FCNTL_JOURNAL_POINTER, &log);
  if (log == nullptr || log->pMethods == nullptr) return {};  // a new store has none
  sqlite3_int64 bytes = 0;
  if (const int code = log->pMethods->xFileSize(log, &bytes); code != SQLITE_OK)
    return failed(code);
  constexpr sqlite3_int64 kPieceBytes = 1 << 16;
  std::vector<char> piece(static_cast<std::size_t>(std::min(bytes, kPieceBytes)));
  for (sqlite3_int64 at = 0; at < bytes; at += kPieceBytes) {
    const int size = static_cast<int>(std::min(kPieceBytes, bytes - at));
    if (const int code = log->pMethods->xRead(log, piece.data(), size, at); code != SQLITE_OK)
      return failed(code);
    if (const int code = log->pMethods->xWrite(log, piece.data(), size, at); code != SQLITE_OK)
      return failed(code);
  }
  if (bytes == 0) return {};
  const int code = log->pMethods->xSync(log, SQLITE_SYNC_NORMAL);
  return code == SQLITE_OK ? Status() : failed(code);
}

}  // namespace focalfleet::store_internal
