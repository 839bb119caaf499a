// A disk that can fail: a file layer for SQLite above the real one. The disk fails in two ways. An
// operation returns an error (the n-th, or all from the n-th on). Or the power is cut; then each
// write since a file's last sync may or may not have reached the disk.
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

  /// The n-th write, sync or truncation from now on (from 1) gives `sqlite_code`; with `lasting`
  /// all later ones, too.
  void FailAt(std::uint64_t n, int sqlite_code, bool lasting);
  void Heal();
  [[nodiscard]] std::uint64_t operations() const { return operations_; }
  [[nodiscard]] bool has_failed() const { return has_failed_; }

  /// Copies the store's file and its WAL as a power cut now might leave them.
  void PowerCut(const std::string& path, const std::string& to, Rng* rng) const;

  // ---- called by the file layer
  int NextOperation();
  void Wrote(const std::string& path, std::int64_t offset, std::string before, std::string after);
  void Truncated(const std::string& path, std::int64_t size);
  void Synced(const std::string& path);

 private:
  struct Write {
    std::int64_t offset = 0;
    std::string before;  // shorter than `after` where the file grew
    std::string after;
  };
  std::uint64_t operations_ = 0;
  std::uint64_t fail_at_ = 0;
  int code_ = 0;
  bool lasting_ = false;
  bool has_failed_ = false;
  std::map<std::string, std::vector<Write>> unsynced_;
};

}  // namespace focalfleet::test
