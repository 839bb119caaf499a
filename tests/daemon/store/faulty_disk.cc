#include "tests/daemon/store/faulty_disk.h"

#include <sqlite3.h>

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <iterator>
#include <new>

#include "protocol/base/check.h"

namespace focalfleet::test {
namespace {

FaultyDisk* g_disk = nullptr;

sqlite3_vfs* Real() {
  static sqlite3_vfs* const real = sqlite3_vfs_find("unix");
  return real;
}

// The real file follows this header in the space that SQLite gives.
struct Header {
  sqlite3_file base;
  std::string* path;
};
sqlite3_file* RealOf(sqlite3_file* file) {
  return reinterpret_cast<sqlite3_file*>(reinterpret_cast<Header*>(file) + 1);
}
const std::string& PathOf(sqlite3_file* file) { return *reinterpret_cast<Header*>(file)->path; }

int Close(sqlite3_file* file) {
  const int code = RealOf(file)->pMethods->xClose(RealOf(file));
  delete reinterpret_cast<Header*>(file)->path;
  return code;
}
int NextRead() { return g_disk->NextOperation(FaultyDisk::Kind::kReads); }
int Read(sqlite3_file* file, void* out, int size, sqlite3_int64 offset) {
  if (const int code = NextRead(); code != SQLITE_OK) return code;
  return RealOf(file)->pMethods->xRead(RealOf(file), out, size, offset);
}
int FileSize(sqlite3_file* file, sqlite3_int64* size) {
  if (const int code = NextRead(); code != SQLITE_OK) return code;
  return RealOf(file)->pMethods->xFileSize(RealOf(file), size);
}
int Write(sqlite3_file* file, const void* data, int size, sqlite3_int64 offset) {
  if (const int code = g_disk->NextOperation(); code != SQLITE_OK) return code;
  g_disk->Touch(PathOf(file));
  const int code = RealOf(file)->pMethods->xWrite(RealOf(file), data, size, offset);
  if (code == SQLITE_OK) {
    g_disk->Wrote(PathOf(file), offset,
                  std::string(static_cast<const char*>(data), static_cast<std::size_t>(size)));
  }
  return code;
}
int Truncate(sqlite3_file* file, sqlite3_int64 size) {
  if (const int code = g_disk->NextOperation(); code != SQLITE_OK) return code;
  g_disk->Touch(PathOf(file));
  const int code = RealOf(file)->pMethods->xTruncate(RealOf(file), size);
  if (code == SQLITE_OK) g_disk->Truncated(PathOf(file), size);
  return code;
}
int Sync(sqlite3_file* file, int flags) {
  int code = g_disk->NextOperation();
  if (code == SQLITE_OK) code = g_disk->NextOperation(FaultyDisk::Kind::kSyncs);
  if (code != SQLITE_OK) {
    g_disk->SyncFailed(PathOf(file));
    return code == SQLITE_FULL ? SQLITE_FULL : SQLITE_IOERR_FSYNC;
  }
  code = RealOf(file)->pMethods->xSync(RealOf(file), flags);
  if (code == SQLITE_OK) g_disk->Synced(PathOf(file));
  return code;
}
int Lock(sqlite3_file* file, int level) {
  if (const int code = NextRead(); code != SQLITE_OK) return code;
  return RealOf(file)->pMethods->xLock(RealOf(file), level);
}
int Unlock(sqlite3_file* file, int level) {
  return RealOf(file)->pMethods->xUnlock(RealOf(file), level);
}
int CheckReserved(sqlite3_file* file, int* out) {
  return RealOf(file)->pMethods->xCheckReservedLock(RealOf(file), out);
}
int FileControl(sqlite3_file* file, int what, void* argument) {
  return RealOf(file)->pMethods->xFileControl(RealOf(file), what, argument);
}
int SectorSize(sqlite3_file* file) { return RealOf(file)->pMethods->xSectorSize(RealOf(file)); }
int Device(sqlite3_file* file) {
  return RealOf(file)->pMethods->xDeviceCharacteristics(RealOf(file));
}
int ShmMap(sqlite3_file* file, int page, int size, int extend, void volatile** out) {
  if (const int code = NextRead(); code != SQLITE_OK) return code;
  return RealOf(file)->pMethods->xShmMap(RealOf(file), page, size, extend, out);
}
int ShmLock(sqlite3_file* file, int offset, int n, int flags) {
  // SQLite takes an unlock for one that cannot fail.
  if ((flags & SQLITE_SHM_LOCK) != 0)
    if (const int code = NextRead(); code != SQLITE_OK) return code;
  return RealOf(file)->pMethods->xShmLock(RealOf(file), offset, n, flags);
}
void ShmBarrier(sqlite3_file* file) { RealOf(file)->pMethods->xShmBarrier(RealOf(file)); }
int ShmUnmap(sqlite3_file* file, int remove) {
  return RealOf(file)->pMethods->xShmUnmap(RealOf(file), remove);
}

constexpr sqlite3_io_methods kMethods = {2,           Close,      Read,    Write,  Truncate,
                                         Sync,        FileSize,   Lock,    Unlock, CheckReserved,
                                         FileControl, SectorSize, Device,  ShmMap, ShmLock,
                                         ShmBarrier,  ShmUnmap,   nullptr, nullptr};

int Open(sqlite3_vfs*, const char* name, sqlite3_file* file, int flags, int* out_flags) {
  const int code = Real()->xOpen(Real(), name, RealOf(file), flags, out_flags);
  file->pMethods = nullptr;
  if (code != SQLITE_OK) return code;
  reinterpret_cast<Header*>(file)->path = new std::string(name == nullptr ? "" : name);
  file->pMethods = &kMethods;
  return code;
}

std::string Slurp(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

}  // namespace

FaultyDisk::FaultyDisk() {
  FOCALFLEET_CHECK(g_disk == nullptr);
  g_disk = this;
  static sqlite3_vfs vfs = *Real();
  vfs.szOsFile = static_cast<int>(sizeof(Header)) + Real()->szOsFile;
  vfs.zName = kVfsName;
  vfs.xOpen = Open;
  sqlite3_vfs_register(&vfs, 0);
}

FaultyDisk::~FaultyDisk() {
  sqlite3_vfs_unregister(sqlite3_vfs_find(kVfsName));
  g_disk = nullptr;
}

void FaultyDisk::FailAt(std::uint64_t n, int sqlite_code, bool lasting, Kind kind) {
  operations_ = 0;
  fail_at_ = n;
  code_ = sqlite_code;
  lasting_ = lasting;
  kind_ = kind;
  has_failed_ = false;
}

void FaultyDisk::Heal() { fail_at_ = 0; }

int FaultyDisk::NextOperation(Kind kind) {
  if (kind != kind_) return SQLITE_OK;
  ++operations_;
  const bool fails =
      fail_at_ != 0 && (lasting_ ? operations_ >= fail_at_ : operations_ == fail_at_);
  has_failed_ = has_failed_ || fails;
  return fails ? code_ : SQLITE_OK;
}

void FaultyDisk::Touch(const std::string& path) {
  if (!files_.contains(path)) files_[path].durable = Slurp(path);
}

void FaultyDisk::Wrote(const std::string& path, std::int64_t offset, std::string bytes) {
  files_[path].unsynced.push_back({static_cast<std::size_t>(offset), std::move(bytes)});
}

void FaultyDisk::Truncated(const std::string& path, std::int64_t size) {
  files_[path].unsynced.push_back({static_cast<std::size_t>(size), ""});
}

void FaultyDisk::Synced(const std::string& path) {
  File& file = files_[path];
  for (const Change& change : file.unsynced)
    if (!change.dropped) Apply(change, &file.durable);
  std::erase_if(file.unsynced, [](const Change& change) { return !change.dropped; });
}

void FaultyDisk::SyncFailed(const std::string& path) {
  for (Change& change : files_[path].unsynced) change.dropped = change.dropped || drops_;
}

void FaultyDisk::Apply(const Change& change, std::string* content) {
  if (change.bytes.empty()) {
    content->resize(std::min(content->size(), change.offset));
    return;
  }
  content->resize(std::max(content->size(), change.offset + change.bytes.size()), '\0');
  content->replace(change.offset, change.bytes.size(), change.bytes);
}

// Each sector of a write reaches the disk by itself: not at all, whole, or its front.
void FaultyDisk::ApplySome(const Change& change, Rng* rng, std::string* content) {
  constexpr std::size_t kSector = 512;
  if (change.bytes.empty() && rng->Below(2) == 0) Apply(change, content);
  for (std::size_t begin = 0; begin < change.bytes.size();) {
    const std::size_t at = change.offset + begin;
    const std::size_t size = std::min(change.bytes.size() - begin, kSector - at % kSector);
    const std::uint64_t fate = rng->Below(3);
    const std::size_t arrives = fate == 0 ? 0 : fate == 1 ? size : rng->Below(size + 1);
    if (arrives > 0) Apply({at, change.bytes.substr(begin, arrives)}, content);
    begin += size;
  }
}

void FaultyDisk::PowerCut(const std::string& path, const std::string& to, Rng* rng) const {
  for (const char* suffix : {"", "-wal"}) {
    const auto file = files_.find(path + suffix);
    std::string content = file == files_.end() ? Slurp(path + suffix) : file->second.durable;
    if (file != files_.end())
      for (const Change& change : file->second.unsynced)
        if (!change.dropped) ApplySome(change, rng, &content);
    std::ofstream(to + suffix, std::ios::binary) << content;
  }
}

}  // namespace focalfleet::test
