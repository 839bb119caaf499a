// The feed of the plate to its viewers. A thread makes each frame once for all of them. A viewer
// that is one frame behind gets the next frame. A viewer that is farther behind gets a snapshot of
// the newest state. There is therefore no queue for a viewer, and one that reads slowly costs no
// memory and holds up nobody. Without viewers no frame is made.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "daemon/http/http_message.h"
#include "daemon/page/plate_frame.h"
#include "daemon/page/plate_table.h"

namespace focalfleet {

class PlateFeed {
 public:
  struct Options {
    const Layout* layout = nullptr;  // outlives the feed
    std::size_t viewers_max = 16;
    /// The pause between two frames, so that no status makes more than that.
    std::chrono::milliseconds pause{25};
    /// The period of looking for a sign of life that is due.
    std::chrono::milliseconds look_period{250};
    std::function<WallTime()> now = &WallTime::Now;
  };
  explicit PlateFeed(Options options);
  PlateFeed(const PlateFeed&) = delete;
  PlateFeed& operator=(const PlateFeed&) = delete;
  /// Streams of viewers end.
  ~PlateFeed();

  /// The newest status. Any thread may call this, and waits at most for one frame to be made.
  void Take(const StatusBatch& batch);
  void NoteAlarm();

  /// The stream of a new viewer. Errors: kFull: there are as many as may be.
  Result<HttpStream> Join();
  [[nodiscard]] std::size_t viewers() const;

 private:
  struct Shared;
  class Viewer;
  static void Run(const std::stop_token& stop, Shared* shared);

  std::shared_ptr<Shared> shared_;  // viewers may outlive the feed
  std::jthread thread_;
};

}  // namespace focalfleet
