#include "tests/daemon/store/faulty_disk.h"

#include <sqlite3.h>

#include <cstdio>
#include <cstring>
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
struct File {
  sqlite3_file base;
  std::string* path;
};
sqlite3_file* RealOf(sqlite3_file* file) {
  return reinterpret_cast<sqlite3_file*>(reinterpret_cast<File*>(file) + 1);
}
const std::string& PathOf(sqlite3_file* file) { return *reinterpret_cast<File*>(file)->path; }

int Close(sqlite3_file* file) {
  const int code = RealOf(file)->pMethods->xClose(RealOf(file));
  delete reinterpret_cast<File*>(file)->path;
  return code;
}
int Read(sqlite3_file* file, void* out, int size, sqlite3_int64 offset) {
  return RealOf(file)->pMethods->xRead(RealOf(file), out, size, offset);
}
int FileSize(sqlite3_file* file, sqlite3_int64* size) {
  return RealOf(file)->pMethods->xFileSize(RealOf(file), size);
}
int Write(sqlite3_file* file, const void* data, int size, sqlite3_int64 offset) {
  if (const int code = g_disk->NextOperation(); code != SQLITE_OK) return code;
  sqlite3_int64 file_size = 0;
  FileSize(file, &file_size);
  std::string before;
  if (file_size > offset) {
    before.resize(static_cast<std::size_t>(std::min<sqlite3_int64>(size, file_size - offset)));
    Read(file, before.data(), static_cast<int>(before.size()), offset);
  }
  const int code = RealOf(file)->pMethods->xWrite(RealOf(file), data, size, offset);
  if (code == SQLITE_OK) {
    g_disk->Wrote(PathOf(file), offset, std::move(before),
                  std::string(static_cast<const char*>(data), static_cast<std::size_t>(size)));
  }
  return code;
}
int Truncate(sqlite3_file* file, sqlite3_int64 size) {
  if (const int code = g_disk->NextOperation(); code != SQLITE_OK) return code;
  const int code = RealOf(file)->pMethods->xTruncate(RealOf(file), size);
  if (code == SQLITE_OK) g_disk->Truncated(PathOf(file), size);
  return code;
}
int Sync(sqlite3_file* file, int flags) {
  if (const int code = g_disk->NextOperation(); code != SQLITE_OK) {
    return code == SQLITE_FULL ? SQLITE_FULL : SQLITE_IOERR_FSYNC;
  }
  const int code = RealOf(file)->pMethods->xSync(RealOf(file), flags);
  if (code == SQLITE_OK) g_disk->Synced(PathOf(file));
  return code;
}
int Lock(sqlite3_file* file, int level) {
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
  // The disk claims nothing (no atomic or safe-append writes), so SQLite relies on its syncs alone.
  static_cast<void>(file);
  return 0;
}
int ShmMap(sqlite3_file* file, int page, int size, int extend, void volatile** out) {
  return RealOf(file)->pMethods->xShmMap(RealOf(file), page, size, extend, out);
}
int ShmLock(sqlite3_file* file, int offset, int n, int flags) {
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
  reinterpret_cast<File*>(file)->path = new std::string(name == nullptr ? "" : name);
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
  vfs.szOsFile = static_cast<int>(sizeof(File)) + Real()->szOsFile;
  vfs.zName = kVfsName;
  vfs.xOpen = Open;
  sqlite3_vfs_register(&vfs, 0);
}

FaultyDisk::~FaultyDisk() {
  sqlite3_vfs_unregister(sqlite3_vfs_find(kVfsName));
  g_disk = nullptr;
}

void FaultyDisk::FailAt(std::uint64_t n, int sqlite_code, bool lasting) {
  operations_ = 0;
  fail_at_ = n;
  code_ = sqlite_code;
  lasting_ = lasting;
  has_failed_ = false;
}

void FaultyDisk::Heal() { fail_at_ = 0; }

int FaultyDisk::NextOperation() {
  ++operations_;
  const bool fails =
      fail_at_ != 0 && (lasting_ ? operations_ >= fail_at_ : operations_ == fail_at_);
  has_failed_ = has_failed_ || fails;
  return fails ? code_ : SQLITE_OK;
}

void FaultyDisk::Wrote(const std::string& path, std::int64_t offset, std::string before,
                       std::string after) {
  unsynced_[path].push_back({offset, std::move(before), std::move(after)});
}

void FaultyDisk::Truncated(const std::string& path, std::int64_t) { unsynced_[path].clear(); }
void FaultyDisk::Synced(const std::string& path) { unsynced_[path].clear(); }

void FaultyDisk::PowerCut(const std::string& path, const std::string& to, Rng* rng) const {
  for (const char* suffix : {"", "-wal"}) {
    std::string content = Slurp(path + suffix);
    if (const auto writes = unsynced_.find(path + suffix); writes != unsynced_.end()) {
      // The file is as of the last sync, then with the writes that happened to reach the disk.
      for (auto write = writes->second.rbegin(); write != writes->second.rend(); ++write) {
        const auto offset = static_cast<std::size_t>(write->offset);
        if (write->before.size() < write->after.size()) {
          content.resize(std::min(content.size(), offset + write->before.size()));
        }
        content.replace(offset, write->before.size(), write->before);
      }
      for (const Write& write : writes->second) {
        if (rng->Below(2) == 0) continue;
        const auto offset = static_cast<std::size_t>(write.offset);
        content.resize(std::max(content.size(), offset + write.after.size()), '\0');
        content.replace(offset, write.after.size(), write.after);
      }
    }
    std::ofstream(to + suffix, std::ios::binary) << content;
  }
}

}  // namespace focalfleet::test
