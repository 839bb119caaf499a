// MemoryDisk is a disk of the simulation: a file layer of SQLite whose files are in memory. Each
// file has two pictures, the written one and the one that is synced. The three ways in which a disk
// goes wrong are:
//
// - An operation fails, by the function `fails`.
// - The process is killed: what it wrote stays, and its open files can do nothing any more.
// - The power is cut: of each sector that was written since the last sync, nothing, all or its
//   front has arrived. A sync that failed may have dropped its pages for good.
//
// Files beside the written ones are never damaged (powersafe overwrite), as the file layer of a
// real disk promises SQLite.
#pragma once

#include <sqlite3.h>

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "protocol/base/rng.h"

namespace focalfleet::soak {

enum class DiskOperation : std::uint8_t { kRead, kWrite, kSync, kTruncate, kOpen };

/// The content of files by their names.
using DiskPicture = std::map<std::string, std::string>;

class MemoryDisk {
 public:
  /// SQLite opens files of this disk under this name of a file layer.
  explicit MemoryDisk(const std::string& name);
  MemoryDisk(const MemoryDisk&) = delete;
  MemoryDisk& operator=(const MemoryDisk&) = delete;
  ~MemoryDisk();

  [[nodiscard]] const char* name() const { return name_.c_str(); }

  /// The error code of SQLite with which the operation fails; SQLITE_OK: it does not.
  std::function<int(DiskOperation)> fails = [](DiskOperation) { return SQLITE_OK; };
  /// Called where a write finds the disk full.
  std::function<void()> was_full = [] {};
  bool drops_failed_syncs = false;   // the kernel takes pages for clean that it could not write
  std::size_t bytes_max = SIZE_MAX;  // of all files together; more is a full disk

  /// Open files can do nothing any more, and their locks are gone.
  void Kill();
  /// As Kill, and the files are as the cut left them.
  void CutPower(Rng* rng);

  /// The files as a power cut now would leave them at least.
  [[nodiscard]] DiskPicture Synced() const;
  /// The files as a process that starts now reads them.
  [[nodiscard]] DiskPicture Written() const;
  [[nodiscard]] std::uint64_t syncs() const { return syncs_; }  // that changed a synced picture
  /// Replaces all files. Pre: none is open.
  void Load(DiskPicture picture);
  [[nodiscard]] std::size_t bytes() const;
  /// The written size of a file; 0: there is none.
  [[nodiscard]] std::size_t size(const std::string& file) const;
  /// Memory of the process that this disk takes. Units: bytes.
  [[nodiscard]] std::size_t memory() const;

 private:
  struct Change {
    std::size_t offset = 0;
    std::string bytes;  // empty: the file was truncated at `offset`
    bool dropped = false;
  };
  struct File {
    std::string written;
    std::string synced;
    std::vector<Change> unsynced;
    // Locks of the open handles.
    int shared = 0;
    const void* reserved = nullptr;
    const void* exclusive = nullptr;
    // Shared memory.
    std::vector<std::unique_ptr<std::array<char, 32768>>> regions;
    std::array<int, SQLITE_SHM_NLOCK> readers{};
    std::array<const void*, SQLITE_SHM_NLOCK> writer{};
  };
  struct Handle;
  struct Layer;  // the functions that SQLite calls

  static void Apply(const Change& change, std::string* content);
  static void ApplySome(const Change& change, Rng* rng, std::string* content);
  void DropLocks();

  std::string name_;
  sqlite3_vfs vfs_{};
  std::uint64_t life_ = 1;  // of the process; handles of an earlier one are dead
  std::uint64_t syncs_ = 0;
  std::map<std::string, std::unique_ptr<File>> files_;
  std::vector<std::unique_ptr<File>> gone_;  // deleted while handles may point to them
  std::vector<std::unique_ptr<std::array<char, 32768>>> old_regions_;
};

}  // namespace focalfleet::soak
