// Whole files in and out. A result file appears complete or not at all: it is written beside its
// place under another name, made durable, and renamed.
#pragma once

#include <string>
#include <string_view>

#include "protocol/base/result.h"

namespace focalfleet {

inline constexpr std::size_t kFileBytesMax = std::size_t{1} << 30;  // a campaign of 5000 units

/// The file's bytes; of a pipe without a name, all until its end.
/// Errors: kUnavailable (missing, unreadable, a directory), kInvalid (larger than kFileBytesMax, a
/// named pipe); names the file.
Result<std::string> ReadFile(const std::string& path);

/// Errors: kInvalid: not UTF-8 text without NUL; names file, row and byte, or what kind of file it
/// is.
Status CheckText(std::string_view text, const std::string& path);

/// As ReadFile, and the bytes are UTF-8 text without NUL.
/// Errors: also those of CheckText.
Result<std::string> ReadTextFile(const std::string& path);

/// `path` holds `text`, or what it held before. A path that is no regular file (a pipe) is written
/// directly; `-` is stdout. Errors: kUnavailable, kFull; names the file.
Status WriteFileAtomically(const std::string& path, const std::string& text);

// ---- for those who hold a descriptor

/// kFull where errno says so, else kUnavailable: "path: what: the system's reason".
tl::unexpected<Error> FailErrno(const std::string& path, const char* what, int error);
/// 0: all written, else errno.
int WriteAll(int fd, std::string_view text);
/// Until the end. Errors: errno; EFBIG where there is more.
tl::expected<std::string, int> ReadAll(int fd, std::size_t bytes_max);

}  // namespace focalfleet
