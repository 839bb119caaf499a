// Options with which writer and readers open the store's file.
#pragma once

#include <chrono>

namespace focalfleet {

struct StoreOptions {
  std::chrono::milliseconds busy_wait{2000};  // wait for a reader that holds the file for a moment
  const char* vfs = nullptr;                  // SQLite's file layer; tests pass a failing one
  /// The file layer keeps the files itself, out of the reach of other processes and of calls of the
  /// system. The store then has no lock file, and its header is read through SQLite alone.
  bool vfs_has_files = false;
};

}  // namespace focalfleet
