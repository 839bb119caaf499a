// These functions read and write whole files. A result file appears complete or not at all: it is
// written beside its place under another name, made durable, and renamed.
#pragma once

#include <string>
#include <string_view>

#include "protocol/base/result.h"

namespace focalfleet {

inline constexpr std::size_t kFileBytesMax = std::size_t{1} << 30;  // enough for a campaign of 5000
                                                                    // units

/// The file's bytes; for a pipe without a name, all until its end.
/// Errors: kUnavailable (missing, unreadable, a directory), kInvalid (larger than kFileBytesMax, a
/// named pipe); names the file.
Result<std::string> ReadFile(const std::string& path);

/// Succeeds where `text` is UTF-8 without NUL.
/// Errors: kInvalid; names file, row and byte, or the kind of file.
Status CheckText(std::string_view text, const std::string& path);

/// The file's text, as ReadFile, checked to be UTF-8 without NUL.
/// Errors: also those of CheckText.
Result<std::string> ReadTextFile(const std::string& path);

/// Afterwards `path` holds `text` or, on failure, what it held before. A path that is no regular
/// file (a pipe) is written directly; `-` is stdout.
/// Errors: kUnavailable, kFull; names the file.
Status WriteFileAtomically(const std::string& path, const std::string& text);

// ---- Functions on an open descriptor

/// An error with the text "path: what: the system's reason". Its code is kFull where errno means
/// so, else kUnavailable.
tl::unexpected<Error> FailErrno(const std::string& path, const char* what, int error);
/// Writes all of `text`. 0: done, else errno.
int WriteAll(int fd, std::string_view text);
/// The bytes up to the end.
/// Errors: errno; EFBIG where there are more than `bytes_max`.
tl::expected<std::string, int> ReadAll(int fd, std::size_t bytes_max);

}  // namespace focalfleet
