// A folder into which others write, held open by its descriptor. Whoever may write there may put
// anything there, also between two of our calls: links to files that are not theirs, pipes that
// nobody fills, devices, folders, files that grow. Nothing of it is followed, waited for or
// removed: what is no regular file is an error that says what it is, and what is written goes
// beside its place and is renamed within the folder.
//
// Names are single ones; where the kernel has openat2 it is told so, too (RESOLVE_BENEATH).
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "daemon/files/descriptor.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// Two looks at one name that find the same thing, unchanged.
struct FileIdentity {
  std::uint64_t device = 0;
  std::uint64_t inode = 0;
  std::int64_t bytes = 0;
  std::int64_t changed_ns = 0;
  friend bool operator==(const FileIdentity&, const FileIdentity&) = default;
};

class GuardedFolder {
 public:
  /// Makes it where it is missing. The path is the operator's: it may lead over links.
  /// Errors: kUnavailable, names it.
  static Result<GuardedFolder> Open(const std::string& path);
  /// A folder in it, made where it is missing. Errors: kUnavailable, also: a link to one is none.
  [[nodiscard]] Result<GuardedFolder> Subfolder(const std::string& name) const;

  /// In their order. Errors: kUnavailable; kFull: more than `count_max`.
  [[nodiscard]] Result<std::vector<std::string>> Names(std::size_t count_max) const;
  /// Nothing: there is none such.
  [[nodiscard]] std::optional<FileIdentity> IdentityOf(const std::string& name) const;
  /// Never waits. Errors: kUnavailable: missing, unreadable; kInvalid: no regular file, larger than
  /// `bytes_max`, changed while it was read.
  [[nodiscard]] Result<std::string> Read(const std::string& name, std::size_t bytes_max) const;
  /// The name is a file with `text`, or as it was before; after a loss of power it may be empty.
  /// Errors: kUnavailable, kFull.
  [[nodiscard]] Status Write(const std::string& name, const std::string& text) const;
  /// Where `to` has something of that name already, the name gets a number. Errors: kUnavailable.
  [[nodiscard]] Status Move(const std::string& name, const GuardedFolder& to) const;

  /// The name as messages have it: with the path, without control characters.
  [[nodiscard]] std::string Shown(const std::string& name) const;

 private:
  GuardedFolder(std::string path, Descriptor fd) : path_(std::move(path)), fd_(std::move(fd)) {}
  std::string path_;
  Descriptor fd_;
};

}  // namespace focalfleet
