// GuardedFolder is a folder into which other users write, held open by its descriptor. Another user
// may put anything there, also between two calls: links to foreign files, pipes without a writer,
// devices, folders, files that grow. GuardedFolder follows, waits for and removes none of these. A
// file that is not regular is an error that names its kind. Files are written beside their place
// and renamed within the folder.
//
// Names are single path components. Where the kernel has openat2, the call also demands this
// (RESOLVE_BENEATH).
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "daemon/files/descriptor.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// The identity of a file. Two looks at one name give equal identities if the file is the same and
/// unchanged.
struct FileIdentity {
  std::uint64_t device = 0;
  std::uint64_t inode = 0;
  std::int64_t bytes = 0;
  std::int64_t changed_ns = 0;
  friend bool operator==(const FileIdentity&, const FileIdentity&) = default;
};

class GuardedFolder {
 public:
  /// Opens the folder, and makes it where it is missing. The path is the operator's, so it may lead
  /// over links.
  /// Errors: kUnavailable, names it.
  static Result<GuardedFolder> Open(const std::string& path);
  /// A folder inside this one, made where it is missing.
  /// Errors: kUnavailable, also where the name is a link to a folder.
  [[nodiscard]] Result<GuardedFolder> Subfolder(const std::string& name) const;

  /// The names in the folder, sorted.
  /// Errors: kUnavailable; kFull: more than `count_max`.
  [[nodiscard]] Result<std::vector<std::string>> Names(std::size_t count_max) const;
  /// The identity of the file of this name; empty: there is none.
  [[nodiscard]] std::optional<FileIdentity> IdentityOf(const std::string& name) const;
  /// The file's bytes. Never waits.
  /// Errors: kUnavailable: missing, unreadable; kInvalid: no regular file, larger than `bytes_max`,
  /// changed while it was read.
  [[nodiscard]] Result<std::string> Read(const std::string& name, std::size_t bytes_max) const;
  /// Afterwards the name is a file with `text`, or as it was before; after a loss of power it may
  /// be empty.
  /// Errors: kUnavailable, kFull.
  [[nodiscard]] Status Write(const std::string& name, const std::string& text) const;
  /// Moves the file. Where `to` already has that name, the name gets a number.
  /// Errors: kUnavailable.
  [[nodiscard]] Status Move(const std::string& name, const GuardedFolder& to) const;

  /// The name as messages show it: with the path, without control characters.
  [[nodiscard]] std::string Shown(const std::string& name) const;

 private:
  GuardedFolder(std::string path, Descriptor fd) : path_(std::move(path)), fd_(std::move(fd)) {}
  std::string path_;
  Descriptor fd_;
};

}  // namespace focalfleet
