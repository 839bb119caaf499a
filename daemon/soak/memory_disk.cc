#include "daemon/soak/memory_disk.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "protocol/base/check.h"

namespace focalfleet::soak {

struct MemoryDisk::Handle {
  sqlite3_file base;
  MemoryDisk* disk;
  File* file;
  std::uint64_t life;
  int level;
  bool temporary;
  std::uint32_t shm_shared;
  std::uint32_t shm_exclusive;
  bool shm;

  [[nodiscard]] bool dead() const { return life != disk->life_; }
  static Handle* Of(sqlite3_file* file) { return reinterpret_cast<Handle*>(file); }
};

struct MemoryDisk::Layer {
  static int Open(sqlite3_vfs* vfs, const char* name, sqlite3_file* file, int flags, int* out) {
    MemoryDisk* disk = static_cast<MemoryDisk*>(vfs->pAppData);
    Handle* handle = Handle::Of(file);
    *handle = Handle{};
    if (const int code = disk->fails(DiskOperation::kOpen); code != SQLITE_OK) return code;
    const std::string path = name == nullptr ? "temporary" : name;
    auto& entry = disk->files_[path];
    if (entry == nullptr) {
      if ((flags & SQLITE_OPEN_CREATE) == 0) {
        disk->files_.erase(path);
        return SQLITE_CANTOPEN;
      }
      entry = std::make_unique<File>();
    }
    handle->disk = disk;
    handle->file = entry.get();
    handle->life = disk->life_;
    handle->base.pMethods = &kMethods;
    if (out != nullptr) *out = flags;
    return SQLITE_OK;
  }
  static int Delete(sqlite3_vfs* vfs, const char* name, int) {
    MemoryDisk* disk = static_cast<MemoryDisk*>(vfs->pAppData);
    const auto found = disk->files_.find(name);
    if (found == disk->files_.end()) return SQLITE_IOERR_DELETE_NOENT;
    if (const int code = disk->fails(DiskOperation::kWrite); code != SQLITE_OK) return code;
    disk->gone_.push_back(std::move(found->second));
    disk->files_.erase(found);
    ++disk->syncs_;
    return SQLITE_OK;
  }
  static int Access(sqlite3_vfs* vfs, const char* name, int, int* out) {
    *out = static_cast<MemoryDisk*>(vfs->pAppData)->files_.contains(name) ? 1 : 0;
    return SQLITE_OK;
  }
  static int FullPath(sqlite3_vfs*, const char* name, int size, char* out) {
    sqlite3_snprintf(size, out, "%s", name);
    return SQLITE_OK;
  }
  static int Randomness(sqlite3_vfs*, int size, char* out) {
    std::memset(out, 0x5a, static_cast<std::size_t>(size));  // salts of a WAL; fixed by the seed
    return size;
  }
  static int Sleep(sqlite3_vfs*, int) { return 0; }
  static int Time(sqlite3_vfs*, double* out) {
    *out = 2460000.5;
    return SQLITE_OK;
  }
  static int LastError(sqlite3_vfs*, int, char*) { return 0; }

  static int Close(sqlite3_file* file) {
    Handle* handle = Handle::Of(file);
    if (handle->dead()) return SQLITE_OK;
    Unlock(file, SQLITE_LOCK_NONE);
    ShmUnmap(file, 0);
    return SQLITE_OK;
  }
  static int Begin(const Handle* handle, DiskOperation operation, int dead_code) {
    if (handle->dead()) return dead_code;
    return handle->disk->fails(operation);
  }
  static int Read(sqlite3_file* file, void* out, int size, sqlite3_int64 offset) {
    const Handle* handle = Handle::Of(file);
    if (const int code = Begin(handle, DiskOperation::kRead, SQLITE_IOERR_READ); code != SQLITE_OK)
      return code;
    const std::string& content = handle->file->written;
    const auto wanted = static_cast<std::size_t>(size);
    const auto begin = std::min(static_cast<std::size_t>(offset), content.size());
    const std::size_t there = std::min(wanted, content.size() - begin);
    std::memcpy(out, content.data() + begin, there);
    std::memset(static_cast<char*>(out) + there, 0, wanted - there);
    return there == wanted ? SQLITE_OK : SQLITE_IOERR_SHORT_READ;
  }
  static int Write(sqlite3_file* file, const void* data, int size, sqlite3_int64 offset) {
    const Handle* handle = Handle::Of(file);
    if (const int code = Begin(handle, DiskOperation::kWrite, SQLITE_IOERR_WRITE);
        code != SQLITE_OK)
      return code;
    MemoryDisk* disk = handle->disk;
    const auto end = static_cast<std::size_t>(offset) + static_cast<std::size_t>(size);
    const std::size_t grows =
        end > handle->file->written.size() ? end - handle->file->written.size() : 0;
    if (grows > 0 && disk->bytes_max != SIZE_MAX && disk->bytes() + grows > disk->bytes_max) {
      disk->was_full();
      return SQLITE_FULL;
    }
    Change change{static_cast<std::size_t>(offset),
                  std::string(static_cast<const char*>(data), static_cast<std::size_t>(size))};
    Apply(change, &handle->file->written);
    handle->file->unsynced.push_back(std::move(change));
    return SQLITE_OK;
  }
  static int Truncate(sqlite3_file* file, sqlite3_int64 size) {
    const Handle* handle = Handle::Of(file);
    if (const int code = Begin(handle, DiskOperation::kTruncate, SQLITE_IOERR_TRUNCATE);
        code != SQLITE_OK)
      return code;
    Change change{static_cast<std::size_t>(size), ""};
    Apply(change, &handle->file->written);
    handle->file->unsynced.push_back(std::move(change));
    return SQLITE_OK;
  }
  static int Sync(sqlite3_file* file, int) {
    const Handle* handle = Handle::Of(file);
    if (handle->dead()) return SQLITE_IOERR_FSYNC;
    if (const int code = handle->disk->fails(DiskOperation::kSync); code != SQLITE_OK) {
      for (Change& change : handle->file->unsynced)
        change.dropped = change.dropped || handle->disk->drops_failed_syncs;
      return SQLITE_IOERR_FSYNC;
    }
    auto& unsynced = handle->file->unsynced;
    for (const Change& change : unsynced)
      if (!change.dropped) Apply(change, &handle->file->synced);
    std::erase_if(unsynced, [](const Change& change) { return !change.dropped; });
    ++handle->disk->syncs_;
    return SQLITE_OK;
  }
  static int Size(sqlite3_file* file, sqlite3_int64* out) {
    const Handle* handle = Handle::Of(file);
    if (const int code = Begin(handle, DiskOperation::kRead, SQLITE_IOERR_FSTAT); code != SQLITE_OK)
      return code;
    *out = static_cast<sqlite3_int64>(handle->file->written.size());
    return SQLITE_OK;
  }
  static int Lock(sqlite3_file* file, int level) {
    Handle* handle = Handle::Of(file);
    if (handle->dead()) return SQLITE_IOERR_LOCK;
    File* of = handle->file;
    if (level <= handle->level) return SQLITE_OK;
    if (level == SQLITE_LOCK_SHARED) {
      if (of->exclusive != nullptr && of->exclusive != handle) return SQLITE_BUSY;
      ++of->shared;
    } else if (level == SQLITE_LOCK_RESERVED) {
      if (of->reserved != nullptr && of->reserved != handle) return SQLITE_BUSY;
      of->reserved = handle;
    } else {
      if (of->exclusive != nullptr && of->exclusive != handle) return SQLITE_BUSY;
      of->exclusive = handle;
      if (of->shared > 1) return SQLITE_BUSY;
    }
    handle->level = level;
    return SQLITE_OK;
  }
  static int Unlock(sqlite3_file* file, int level) {
    Handle* handle = Handle::Of(file);
    if (handle->dead() || level >= handle->level) return SQLITE_OK;
    File* of = handle->file;
    if (of->exclusive == handle) of->exclusive = nullptr;
    if (of->reserved == handle) of->reserved = nullptr;
    if (level == SQLITE_LOCK_NONE && handle->level >= SQLITE_LOCK_SHARED) --of->shared;
    handle->level = level;
    return SQLITE_OK;
  }
  static int Reserved(sqlite3_file* file, int* out) {
    *out = Handle::Of(file)->file->reserved != nullptr ? 1 : 0;
    return SQLITE_OK;
  }
  static int Control(sqlite3_file*, int what, void* argument) {
    if (what != SQLITE_FCNTL_POWERSAFE_OVERWRITE) return SQLITE_NOTFOUND;
    *static_cast<int*>(argument) = 1;
    return SQLITE_OK;
  }
  static int SectorSize(sqlite3_file*) { return 4096; }
  static int Device(sqlite3_file*) { return SQLITE_IOCAP_POWERSAFE_OVERWRITE; }

  static int ShmMap(sqlite3_file* file, int page, int size, int extend, void volatile** out) {
    Handle* handle = Handle::Of(file);
    *out = nullptr;
    if (handle->dead()) return SQLITE_IOERR_SHMMAP;
    auto& regions = handle->file->regions;
    FOCALFLEET_CHECK(size == 32768);
    const auto wanted = static_cast<std::size_t>(page);
    if (wanted >= regions.size() && extend == 0) return SQLITE_OK;
    while (regions.size() <= wanted) regions.push_back(std::make_unique<std::array<char, 32768>>());
    handle->shm = true;
    *out = regions[wanted]->data();
    return SQLITE_OK;
  }
  static int ShmLock(sqlite3_file* file, int offset, int n, int flags) {
    Handle* handle = Handle::Of(file);
    if (handle->dead()) return SQLITE_IOERR_SHMLOCK;
    File* of = handle->file;
    const auto slots = [&](const auto& each) {
      for (int slot = offset; slot < offset + n; ++slot)
        each(static_cast<std::size_t>(slot), std::uint32_t{1} << slot);
    };
    if ((flags & SQLITE_SHM_UNLOCK) != 0) {
      slots([&](std::size_t slot, std::uint32_t bit) {
        if ((handle->shm_shared & bit) != 0) --of->readers[slot];
        if ((handle->shm_exclusive & bit) != 0) of->writer[slot] = nullptr;
        handle->shm_shared &= ~bit;
        handle->shm_exclusive &= ~bit;
      });
      return SQLITE_OK;
    }
    bool busy = false;
    const bool shared = (flags & SQLITE_SHM_SHARED) != 0;
    slots([&](std::size_t slot, std::uint32_t bit) {
      busy |= of->writer[slot] != nullptr && of->writer[slot] != handle;
      const int others = of->readers[slot] - ((handle->shm_shared & bit) != 0 ? 1 : 0);
      busy |= !shared && others > 0;
    });
    if (busy) return SQLITE_BUSY;
    slots([&](std::size_t slot, std::uint32_t bit) {
      if (shared && (handle->shm_shared & bit) == 0) {
        ++of->readers[slot];
        handle->shm_shared |= bit;
      } else if (!shared) {
        of->writer[slot] = handle;
        handle->shm_exclusive |= bit;
      }
    });
    return SQLITE_OK;
  }
  static void ShmBarrier(sqlite3_file*) {}
  static int ShmUnmap(sqlite3_file* file, int) {
    Handle* handle = Handle::Of(file);
    if (handle->dead() || !handle->shm) return SQLITE_OK;
    ShmLock(file, 0, SQLITE_SHM_NLOCK, SQLITE_SHM_UNLOCK | SQLITE_SHM_SHARED);
    handle->shm = false;
    return SQLITE_OK;
  }

  static constexpr sqlite3_io_methods kMethods = {2,          Close,      Read,    Write,  Truncate,
                                                  Sync,       Size,       Lock,    Unlock, Reserved,
                                                  Control,    SectorSize, Device,  ShmMap, ShmLock,
                                                  ShmBarrier, ShmUnmap,   nullptr, nullptr};
};

MemoryDisk::MemoryDisk(const std::string& name) : name_(name) {
  vfs_.iVersion = 1;
  vfs_.szOsFile = static_cast<int>(sizeof(Handle));
  vfs_.mxPathname = 512;
  vfs_.zName = name_.c_str();
  vfs_.pAppData = this;
  vfs_.xOpen = Layer::Open;
  vfs_.xDelete = Layer::Delete;
  vfs_.xAccess = Layer::Access;
  vfs_.xFullPathname = Layer::FullPath;
  vfs_.xRandomness = Layer::Randomness;
  vfs_.xSleep = Layer::Sleep;
  vfs_.xCurrentTime = Layer::Time;
  vfs_.xGetLastError = Layer::LastError;
  sqlite3_vfs_register(&vfs_, 0);
}

MemoryDisk::~MemoryDisk() { sqlite3_vfs_unregister(&vfs_); }

void MemoryDisk::DropLocks() {
  for (auto& [path, file] : files_) {
    file->shared = 0;
    file->reserved = file->exclusive = nullptr;
    file->readers.fill(0);
    file->writer.fill(nullptr);
    // Connections of the dead process still point into the regions until they are closed.
    for (auto& region : file->regions) old_regions_.push_back(std::move(region));
    file->regions.clear();
  }
}

void MemoryDisk::Kill() {
  ++life_;
  DropLocks();
}

void MemoryDisk::CutPower(Rng* rng) {
  Kill();
  for (auto& [path, file] : files_) {
    for (const Change& change : file->unsynced)
      if (!change.dropped) ApplySome(change, rng, &file->synced);
    file->unsynced.clear();
    file->written = file->synced;
  }
  ++syncs_;
}

DiskPicture MemoryDisk::Synced() const {
  DiskPicture picture;
  for (const auto& [path, file] : files_) picture[path] = file->synced;
  return picture;
}

DiskPicture MemoryDisk::Written() const {
  DiskPicture picture;
  for (const auto& [path, file] : files_) picture[path] = file->written;
  return picture;
}

void MemoryDisk::Load(DiskPicture picture) {
  files_.clear();
  gone_.clear();
  old_regions_.clear();
  for (auto& [path, content] : picture) {
    auto file = std::make_unique<File>();
    file->written = file->synced = std::move(content);
    files_[path] = std::move(file);
  }
}

std::size_t MemoryDisk::bytes() const {
  std::size_t sum = 0;
  for (const auto& [path, file] : files_) sum += file->written.size();
  return sum;
}

std::size_t MemoryDisk::size(const std::string& file) const {
  const auto found = files_.find(file);
  return found == files_.end() ? 0 : found->second->written.size();
}

std::size_t MemoryDisk::memory() const {
  std::size_t sum = sizeof(*old_regions_.front()) * old_regions_.size();
  for (const auto& file : gone_) sum += file->written.capacity() + file->synced.capacity();
  for (const auto& [path, file] : files_) {
    sum += file->written.capacity() + file->synced.capacity();
    sum += sizeof(*file->regions.front()) * file->regions.size();
    for (const Change& change : file->unsynced) sum += sizeof(change) + change.bytes.capacity();
  }
  return sum;
}

void MemoryDisk::Apply(const Change& change, std::string* content) {
  if (change.bytes.empty()) {
    content->resize(std::min(content->size(), change.offset));
    return;
  }
  content->resize(std::max(content->size(), change.offset + change.bytes.size()), '\0');
  content->replace(change.offset, change.bytes.size(), change.bytes);
}

// Each sector of a write reaches the disk by itself: not at all, whole, or its front.
void MemoryDisk::ApplySome(const Change& change, Rng* rng, std::string* content) {
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

}  // namespace focalfleet::soak
