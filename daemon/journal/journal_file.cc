#include "daemon/journal/journal_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <system_error>
#include <utility>

#include "daemon/clock/wall_time.h"
#include "daemon/files/text_file.h"
#include "daemon/journal/fields.h"
#include "daemon/journal/journal_block.h"

namespace focalfleet::journal {
namespace {

namespace fs = std::filesystem;

constexpr std::uint32_t kFormat = 1;
/// A file is at most this share of the folder's limit, so that the limit is kept within so much.
constexpr std::uint64_t kFilesOfLimit = 16;
constexpr std::uint64_t kFileBytesLeast = 64 << 10;
constexpr std::uint64_t kFileBytesMost = 64 << 20;  // a reader has a whole file in memory
/// The store on the same disk must not run out of room: so much stays free. A store of 5000 units
/// with one configuration takes 1.6 MB. Half of it would do, too, for a night of 50 configurations;
/// twice as much would forbid a journal on small test machines.
constexpr std::uintmax_t kFreeBytesLeast = 256 << 20;

struct Head {
  std::uint32_t format = kFormat;
  std::string version;
  std::string life;
  std::uint64_t number = 0;
};

/// A file is closed at this size.
std::uint64_t FileBytesOf(std::uint64_t limit_bytes) {
  return std::clamp(limit_bytes / kFilesOfLimit, kFileBytesLeast, kFileBytesMost);
}

std::string BeginningIsGone(const std::string& file) {
  return file +
         ": the beginning of this life is not there any more, and it cannot be replayed from "
         "its middle";
}

std::string NameOf(const std::string& life, std::uint64_t number) {
  return fmt::format("{}.{:06}{}", life, number, kJournalEnding);
}

/// The life's part of a file's name; empty: no journal file.
std::string LifeOfName(const std::string& name) {
  const std::size_t ending = name.rfind(kJournalEnding);
  if (ending == std::string::npos ||
      ending + std::string_view(kJournalEnding).size() != name.size())
    return {};
  const std::size_t dot = name.rfind('.', ending - 1);
  return dot == std::string::npos ? std::string() : name.substr(0, dot);
}

/// Journal files of the folder by name.
std::vector<fs::path> FilesOf(const fs::path& folder) {
  std::vector<fs::path> files;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error))
    if (!LifeOfName(entry.path().filename()).empty()) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

Status CheckRoom(const std::string& folder) {
  std::error_code error;
  const fs::space_info space = fs::space(folder, error);
  if (error || space.available >= kFreeBytesLeast) return {};
  return Fail(ErrorCode::kFull,
              fmt::format("{}: less than {} MiB are free, which are kept for the store", folder,
                          kFreeBytesLeast >> 20));
}

/// The head of a file, taken off. Errors: as TakeBlock; kInvalid, kNewer.
Result<Head> TakeHead(std::string_view* bytes) {
  FOCALFLEET_TRY_ASSIGN(const Block block, TakeBlock(bytes));
  Head head;
  ByteReader reader{block.bytes};
  ReadFields(&reader, &head.format);
  if (block.kind != BlockKind::kHead || !reader.good)
    return Fail(ErrorCode::kInvalid, "this is no journal");
  if (head.format != kFormat)
    return Fail(ErrorCode::kNewer, fmt::format("its format is {}; this program reads format {}",
                                               head.format, kFormat));
  ReadFields(&reader, &head.version);
  ReadFields(&reader, &head.life);
  ReadFields(&reader, &head.number);
  if (!reader.good) return Fail(ErrorCode::kInvalid, "this is no journal");
  return head;
}

}  // namespace

// ---- Writing

JournalWriter::JournalWriter(Options options, std::string life, std::string version)
    : options_(std::move(options)), life_(std::move(life)), version_(std::move(version)) {}

Result<std::unique_ptr<JournalWriter>> JournalWriter::Open(Options options,
                                                           const LifeRecord& life) {
  std::string name = ToIso8601(life.at);
  std::erase_if(name, [](char letter) { return letter == '-' || letter == ':'; });
  if (::mkdir(options.folder.c_str(), 0750) != 0 && errno != EEXIST)
    return FailErrno(options.folder, "cannot be made", errno);
  std::unique_ptr<JournalWriter> writer(
      new JournalWriter(std::move(options), std::move(name), life.version));
  FOCALFLEET_TRY(writer->OpenNext());
  Status begun =
      writer->Append(Packed({.kind = BlockKind::kLife, .records = 1, .bytes = BytesOf(life)}));
  if (!begun) {
    ::unlink(writer->path_.c_str());  // it is opened anew under this name
    return tl::unexpected<Error>(std::move(begun).error());
  }
  return writer;
}

/// Afterwards the next file is open and has its head, or the one before is still open.
Status JournalWriter::OpenNext() {
  const std::uint64_t number = number_ + 1;
  const std::string path = (fs::path(options_.folder) / NameOf(life_, number)).string();
  FOCALFLEET_TRY(CheckRoom(options_.folder));
  Descriptor file(::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0640));
  if (file.get() < 0) return FailErrno(path, "cannot be created", errno);
  Block block{.kind = BlockKind::kHead};
  WriteFields(Head{.version = version_, .life = life_, .number = number}, &block.bytes);
  const std::string head = Packed(block);
  if (const int error = WriteAll(file.get(), head); error != 0) {
    ::unlink(path.c_str());
    return FailErrno(path, "cannot be written", error);
  }
  file_ = std::move(file);
  path_ = path;
  number_ = number;
  bytes_ = head.size();
  RemoveOldest();
  return {};
}

Status JournalWriter::Append(std::string_view block) {
  const int error = WriteAll(file_.get(), block);
  if (error == 0) {
    bytes_ += block.size();
    return {};
  }
  // The file ends with a whole block again.
  const auto whole = static_cast<off_t>(bytes_);
  if (::ftruncate(file_.get(), whole) != 0 || ::lseek(file_.get(), whole, SEEK_SET) != whole)
    file_ = Descriptor();
  return FailErrno(path_, "cannot be written", error);
}

Status JournalWriter::Write(std::span<const NumberedRecord> records) {
  FOCALFLEET_TRY(CheckRoom(options_.folder));
  const std::uint64_t file_bytes = FileBytesOf(options_.limit_bytes);
  // Unpacked, but for a record that is larger.
  const std::uint64_t block_bytes = std::min<std::uint64_t>(1 << 20, file_bytes);
  for (std::size_t n = 0; n < records.size();) {
    Block block{.kind = BlockKind::kSteps, .first_step = records[n].step};
    do {
      WriteFields(records[n].bytes, &block.bytes);
      ++block.records;
      ++n;
    } while (n < records.size() && records[n].step == records[n - 1].step + 1 &&
             block.bytes.size() < block_bytes);
    if (file_.get() < 0 || bytes_ > file_bytes) FOCALFLEET_TRY(OpenNext());
    FOCALFLEET_TRY(Append(Packed(block)));
  }
  return {};
}

Status JournalWriter::End() {
  if (file_.get() < 0) return Fail(ErrorCode::kUnavailable, path_ + ": is not open");
  return Append(Packed({.kind = BlockKind::kEnd}));
}

void JournalWriter::RemoveOldest() {
  std::vector<fs::path> files = FilesOf(options_.folder);
  std::ranges::stable_partition(
      files, [this](const fs::path& file) { return LifeOfName(file.filename()) != life_; });
  std::uint64_t sum = 0;
  std::error_code error;
  const auto bytes = [&error](const fs::path& file) {
    const auto size = fs::file_size(file, error);
    return error ? 0 : static_cast<std::uint64_t>(size);
  };
  for (const fs::path& file : files) sum += bytes(file);
  const std::uint64_t room = FileBytesOf(options_.limit_bytes);
  for (const fs::path& file : files) {
    if (sum + room <= options_.limit_bytes || file == path_) return;
    sum -= bytes(file);
    fs::remove(file, error);
    if (LifeOfName(file.filename()) == life_) whole_ = false;
  }
}

// ---- Reading

Result<JournalReader> JournalReader::Open(const std::string& path) {
  std::error_code error;
  const bool is_folder = fs::is_directory(path, error);
  if (!is_folder && !fs::exists(path, error))
    return Fail(ErrorCode::kUnavailable, path + ": there is no such file or folder");
  const fs::path parent = fs::path(path).parent_path();
  const fs::path folder = is_folder ? fs::path(path) : parent.empty() ? fs::path(".") : parent;
  const std::vector<fs::path> files = FilesOf(folder);
  const std::string chosen =
      is_folder ? files.empty() ? std::string() : LifeOfName(files.back().filename())
                : LifeOfName(fs::path(path).filename());
  if (chosen.empty())
    return Fail(ErrorCode::kInvalid,
                fmt::format("{}: {} *{}", path,
                            is_folder ? "the folder has no files" : "the name is not of the kind",
                            kJournalEnding));
  JournalReader reader;
  for (const fs::path& file : files)
    if (LifeOfName(file.filename()) == chosen) reader.files_.push_back(file.string());
  const auto found = reader.NextBlock();
  if (!found) return tl::unexpected<Error>(found.error());
  if (!*found || reader.life_.units.empty())
    return Fail(ErrorCode::kInvalid, BeginningIsGone(reader.files_.front()));
  return reader;
}

Result<std::optional<std::string_view>> JournalReader::Next() {
  while (at_ == block_.size()) {
    FOCALFLEET_TRY_ASSIGN(const bool more, NextBlock());
    if (!more) return std::optional<std::string_view>();
  }
  ByteReader reader{std::string_view(block_).substr(at_)};
  const std::size_t size = internal::ReadSize(&reader);
  if (!reader.good)
    return Fail(ErrorCode::kInvalid, fmt::format("the record of step {} is damaged", step_ + 1));
  at_ = block_.size() - reader.left.size() + size;
  ++step_;
  return std::optional(reader.left.substr(0, size));
}

/// False: there is no further block.
Result<bool> JournalReader::NextBlock() {
  const auto named = [this](const Error& error) {
    return Fail(error.code, fmt::format("{}: {}", files_[next_file_ - 1], error.text));
  };
  std::string_view left = std::string_view(file_).substr(place_);
  while (left.empty()) {
    if (next_file_ == files_.size()) return false;
    FOCALFLEET_TRY_ASSIGN(file_, ReadFile(files_[next_file_]));
    ++next_file_;
    bytes_ += file_.size();
    left = file_;
    const auto head = TakeHead(&left);
    if (!head && head.error().code == ErrorCode::kFull && next_file_ == files_.size()) {
      end_ = End::kLastTorn;
      left = {};
      file_.clear();
      place_ = 0;
      continue;
    }
    if (!head) return named(head.error());
    if (head->number != next_file_)
      return Fail(ErrorCode::kInvalid,
                  next_file_ == 1
                      ? BeginningIsGone(files_.front())
                      : fmt::format("{}: the file before it is missing", files_[next_file_ - 1]));
    version_ = head->version;
    place_ = file_.size() - left.size();
  }
  auto block = TakeBlock(&left);
  if (!block && block.error().code == ErrorCode::kFull && next_file_ == files_.size()) {
    end_ = End::kLastTorn;
    place_ = file_.size();
    return false;
  }
  if (!block) return named(block.error());
  place_ = file_.size() - left.size();
  block_.clear();
  at_ = 0;
  switch (block->kind) {
    case BlockKind::kLife: {
      auto life = LifeFrom(block->bytes);
      if (!life)
        return named({life.error().code,
                      fmt::format("{}; version {} wrote it", life.error().text, version_)});
      life_ = std::move(*life);
      return true;
    }
    case BlockKind::kSteps:
      if (block->first_step != step_ + 1)
        return Fail(ErrorCode::kInvalid, fmt::format("steps {} to {} are not in the journal",
                                                     step_ + 1, block->first_step - 1));
      block_ = std::move(block->bytes);
      return true;
    case BlockKind::kEnd:
      end_ = End::kWhole;
      return true;
    case BlockKind::kHead:
      break;
  }
  return named({ErrorCode::kInvalid, "a block is out of its place"});
}

}  // namespace focalfleet::journal
