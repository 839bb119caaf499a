// A disk that can fail: a file layer for SQLite above the real one. The disk fails in two ways. An
// operation returns an error (the n-th, or all from the n-th on). Or the power is cut. Then each
// sector of each write since a file's last sync may have reached the disk whole, in part or not at
// all, and each truncation since then may or may not have.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "protocol/base/rng.h"

namespace focalfleet::test {

class FaultyDisk {
 public:
  static constexpr const char* kVfsName = "faulty_disk";

  /// Pre: there is no other such disk, because SQLite knows file layers by name, once a process.
  FaultyDisk();
  FaultyDisk(const FaultyDisk&) = delete;
  FaultyDisk& operator=(const FaultyDisk&) = delete;
  ~FaultyDisk();

  enum class Kind : std::uint8_t {
    kWrites,  // writes, syncs and truncations
    kReads,   // reads, sizes, locks and shared memory
    kSyncs    // syncs alone
  };
  /// The n-th operation of the kind from now on (from 1) gives `sqlite_code`; with `lasting` all
  /// later ones, too.
  void FailAt(std::uint64_t n, int sqlite_code, bool lasting, Kind kind = Kind::kWrites);
  /// Changes that a failed sync was to make durable are forgotten: as with Linux, they stay in the
  /// page cache, count as written, and are gone after a power cut.
  void DropAtFailedSyncs() { drops_ = true; }
  void Heal();
  [[nodiscard]] std::uint64_t operations() const { return operations_; }
  [[nodiscard]] bool has_failed() const { return has_failed_; }

  /// Copies the store's file and its WAL as a power cut now might leave them.
  void PowerCut(const std::string& path, const std::string& to, Rng* rng) const;

  // ---- called by the file layer
  int NextOperation(Kind kind = Kind::kWrites);
  /// Called before the first change of a file.
  void Touch(const std::string& path);
  void Wrote(const std::string& path, std::int64_t offset, std::string bytes);
  void Truncated(const std::string& path, std::int64_t size);
  void Synced(const std::string& path);
  void SyncFailed(const std::string& path);

 private:
  struct Change {
    std::size_t offset = 0;
    std::string bytes;     // empty: the file was truncated at `offset`
    bool dropped = false;  // never reaches the disk
  };
  struct File {
    std::string durable;  // as a power cut leaves it at least
    std::vector<Change> unsynced;
  };
  static void Apply(const Change& change, std::string* content);
  static void ApplySome(const Change& change, Rng* rng, std::string* content);

  std::uint64_t operations_ = 0;
  std::uint64_t fail_at_ = 0;
  int code_ = 0;
  bool lasting_ = false;
  Kind kind_ = Kind::kWrites;
  bool drops_ = false;
  bool has_failed_ = false;
  std::map<std::string, File> files_;
};

}  // namespace focalfleet::test
