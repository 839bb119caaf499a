// Whole files in and out. A result file appears complete or not at all: it is written beside its
// place under another name, made durable, and renamed.
#pragma once

#include <string>

#include "protocol/base/result.h"

namespace focalfleet {

inline constexpr std::size_t kFileBytesMax = std::size_t{1} << 30;  // a campaign of 5000 units

/// The file's bytes; of a pipe without a name, all until its end.
/// Errors: kUnavailable (missing, unreadable, a directory), kInvalid (larger than kFileBytesMax, a
/// named pipe); names the file.
Result<std::string> ReadFile(const std::string& path);

/// As ReadFile, and the bytes are UTF-8 text without NUL.
/// Errors: also kInvalid, names file, row and byte.
Result<std::string> ReadTextFile(const std::string& path);

/// `path` holds `text`, or what it held before. A path that is no regular file (a pipe) is written
/// directly; `-` is stdout. Errors: kUnavailable, kFull; names the file.
Status WriteFileAtomically(const std::string& path, const std::string& text);

}  // namespace focalfleet
