// Options with which writer and readers open the store's file.
#pragma once

#include <chrono>

namespace focalfleet {

struct StoreOptions {
  std::chrono::milliseconds busy_wait{2000};  // wait for a reader that holds the file for a moment
  const char* vfs = nullptr;                  // SQLite's file layer; tests pass a failing one
};

}  // namespace focalfleet
