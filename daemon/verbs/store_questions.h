// Questions to the store. A question is made on the core thread, with all that it needs as values,
// and is answered on the reader's thread: the core never waits for SQLite.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>

#include "daemon/control/messages.h"
#include "daemon/store/store_reader.h"

namespace focalfleet {

/// Reads what the answer needs.
using StoreReading = std::function<Result<Json>(StoreReader* store)>;

struct StoreQuestion {
  std::uint64_t number = 0;   // of this daemon
  std::uint64_t request = 0;  // of the client
  StoreReading read;
};
struct StoreAnswer {
  std::uint64_t number = 0;
  std::string line;  // for the client, whole
};

/// The work of the reader's thread. The store is opened with the first question.
class StoreQuestions {
 public:
  explicit StoreQuestions(std::string path, const StoreOptions& options = {})
      : path_(std::move(path)), options_(options) {}
  /// Once `ending` is true the answer comes soon and says so. Pre: `ending` is the same each time.
  StoreAnswer operator()(const StoreQuestion& question, const std::atomic<bool>& ending);

 private:
  std::string path_;
  StoreOptions options_;
  std::shared_ptr<StoreReader> reader_;
};

}  // namespace focalfleet
