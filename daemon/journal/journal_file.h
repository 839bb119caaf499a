// A journal is a folder of files. Each life of the daemon has its own, numbered from 1; the first
// one begins with the record of the life (life_record.h). The files hold packed blocks of the
// records of steps (step_record.h), each block with a checksum.
//
//   file   = block of kind kHead, then further blocks
//   block  = header, packed bytes
//   header = "FFJB", kind, first step, records, unpacked bytes, packed bytes, CRC-32 of the packed
//            bytes, CRC-32 of the header
//
// A name is the life's begin and the file's number, so that names sort by age. The oldest files go
// when the folder is over its limit, those of the present life last, because a life that has lost
// its first file can no longer be replayed. A process that is killed leaves a last block that ends
// early; the blocks before it are whole.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/files/descriptor.h"
#include "daemon/journal/life_record.h"
#include "protocol/base/result.h"

namespace focalfleet::journal {

inline constexpr const char* kJournalEnding = ".journal";

/// A record with the number of its step, from 1.
struct NumberedRecord {
  std::uint64_t step = 0;
  std::string bytes;
};

class JournalWriter {
 public:
  struct Options {
    std::string folder;             // made where it is missing
    std::uint64_t limit_bytes = 0;  // of the folder's journal files
  };

  /// The first file of the life is there, with its record. Errors: kUnavailable, kFull: the folder
  /// or the file cannot be written.
  static Result<std::unique_ptr<JournalWriter>> Open(Options options, const LifeRecord& life);

  /// Adds the records, which may have gaps in their numbers. After an error none of those that
  /// follow the last whole block are in the journal, and the next call goes on behind that block.
  /// Errors: kUnavailable, kFull.
  Status Write(std::span<const NumberedRecord> records);
  /// The life has ended with all its steps written.
  Status End();
  /// All of this life's files are there.
  [[nodiscard]] bool whole() const { return whole_; }

 private:
  JournalWriter(Options options, std::string life, std::string version);
  Status OpenNext();
  Status Append(std::string_view block);
  void RemoveOldest();

  Options options_;
  std::string life_;  // the first part of its files' names
  std::uint64_t number_ = 0;
  Descriptor file_;
  std::string path_;
  std::uint64_t bytes_ = 0;  // of the file, whole blocks
  bool whole_ = true;
  std::string version_;
};

/// Reads one life from its first step to its last.
class JournalReader {
 public:
  /// `path` is a file of a life, or a folder, of which the newest life is read.
  /// Errors: kUnavailable: it cannot be read; kInvalid: no journal, or the life's first file is
  /// gone.
  static Result<JournalReader> Open(const std::string& path);

  [[nodiscard]] const LifeRecord& life() const { return life_; }
  /// Version of the program that wrote the newest file read so far; empty: none could be read.
  [[nodiscard]] const std::string& version() const { return version_; }
  /// The next record, in the order of steps; none: the journal ends here, see `end`. The text stays
  /// valid until the next call. Errors: kInvalid: steps are missing, or a block in the middle is
  /// damaged; the text says which.
  Result<std::optional<std::string_view>> Next();

  enum class End : std::uint8_t {
    kWhole,    // the daemon ended, with all its steps written
    kCutOff,   // the process was killed, or still runs: the newest steps may be missing
    kLastTorn  // the same, in the middle of a block
  };
  [[nodiscard]] End end() const { return end_; }
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }  // of all files read so far

 private:
  Result<bool> NextBlock();

  std::vector<std::string> files_;  // of the life, ascending
  std::size_t next_file_ = 0;
  std::string file_;        // bytes of the present one
  std::size_t place_ = 0;   // in it
  std::string block_;       // unpacked
  std::size_t at_ = 0;      // in it
  std::uint64_t step_ = 0;  // of the last record
  std::uint64_t bytes_ = 0;
  std::string version_;
  LifeRecord life_;
  End end_ = End::kCutOff;
};

}  // namespace focalfleet::journal
