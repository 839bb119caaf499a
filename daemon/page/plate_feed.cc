#include "daemon/page/plate_feed.h"

#include <utility>

#include "daemon/loop/thread_name.h"

namespace focalfleet {

using Frame = std::shared_ptr<const std::string>;

struct PlateFeed::Shared {
  explicit Shared(Options given)
      : options(std::move(given)), table(options.layout), encoder(options.layout->size()) {}

  const Options options;
  std::mutex mutex;
  // ---- under the mutex
  std::condition_variable_any news;    // for the thread: status, or a first viewer
  std::condition_variable_any frames;  // for the viewers
  PlateTable table;
  PlateEncoder encoder;
  Frame newest;    // the delta that has the encoder's number
  Frame snapshot;  // of the same number; null: nobody needed it
  std::size_t viewers = 0;
  bool has_news = false;
  bool ended = false;
};

class PlateFeed::Viewer {
 public:
  explicit Viewer(std::shared_ptr<Shared> shared) : shared_(std::move(shared)) {}
  Viewer(const Viewer&) = delete;
  Viewer& operator=(const Viewer&) = delete;
  ~Viewer() {
    const std::lock_guard lock(shared_->mutex);
    --shared_->viewers;
  }

  /// Null: nothing new came within `patience`. None: the feed has ended.
  std::optional<Frame> Next(std::chrono::milliseconds patience) {
    std::unique_lock lock(shared_->mutex);
    Shared& all = *shared_;
    all.frames.wait_for(lock, patience, [&] {
      return all.ended || (all.newest != nullptr && all.encoder.number() != number_);
    });
    if (all.ended) return std::nullopt;
    if (all.newest == nullptr || all.encoder.number() == number_) return Frame();
    const bool follows = number_ != 0 && all.encoder.number() == number_ + 1;
    number_ = all.encoder.number();
    if (follows) return all.newest;
    if (all.snapshot == nullptr)
      all.snapshot = std::make_shared<const std::string>(all.encoder.Snapshot(all.options.now()));
    return all.snapshot;
  }

 private:
  std::shared_ptr<Shared> shared_;
  std::uint32_t number_ = 0;  // of the last frame; 0: none yet
};

PlateFeed::PlateFeed(Options options)
    : shared_(std::make_shared<Shared>(std::move(options))),
      thread_([shared = shared_.get()](const std::stop_token& stop) { Run(stop, shared); }) {}

PlateFeed::~PlateFeed() {
  thread_.request_stop();
  {
    const std::lock_guard lock(shared_->mutex);
    shared_->ended = true;
  }
  shared_->news.notify_all();
  shared_->frames.notify_all();
  thread_.join();
}

void PlateFeed::Take(const StatusBatch& batch) {
  const std::lock_guard lock(shared_->mutex);
  shared_->table.Take(batch);
  shared_->has_news = true;
  if (shared_->viewers > 0) shared_->news.notify_one();
}

void PlateFeed::NoteAlarm() {
  const std::lock_guard lock(shared_->mutex);
  shared_->table.NoteAlarm();
  shared_->has_news = true;
  if (shared_->viewers > 0) shared_->news.notify_one();
}

Result<HttpStream> PlateFeed::Join() {
  const std::lock_guard lock(shared_->mutex);
  if (shared_->viewers >= shared_->options.viewers_max)
    return Fail(ErrorCode::kFull,
                "all " + std::to_string(shared_->options.viewers_max) +
                    " places for viewers are taken ([http] viewers_max): close a page elsewhere");
  ++shared_->viewers;
  shared_->has_news = true;
  shared_->news.notify_one();
  const auto viewer = std::make_shared<Viewer>(shared_);
  return HttpStream(
      [viewer](std::chrono::milliseconds patience) { return viewer->Next(patience); });
}

std::size_t PlateFeed::viewers() const {
  const std::lock_guard lock(shared_->mutex);
  return shared_->viewers;
}

void PlateFeed::Run(const std::stop_token& stop, Shared* shared) {
  NameThisThread("page");
  std::unique_lock lock(shared->mutex);
  while (!stop.stop_requested()) {
    if (shared->viewers == 0)
      shared->news.wait(lock, stop, [&] { return shared->viewers > 0; });
    else
      shared->news.wait_for(lock, stop, shared->options.look_period,
                            [&] { return shared->has_news; });
    if (stop.stop_requested() || shared->viewers == 0) continue;
    shared->has_news = false;
    std::string frame = shared->encoder.Next(shared->table, shared->options.now());
    if (frame.empty()) continue;
    shared->newest = std::make_shared<const std::string>(std::move(frame));
    shared->snapshot = nullptr;
    shared->frames.notify_all();
    // The pause is without the lock, and ends with the feed.
    shared->news.wait_for(lock, stop, shared->options.pause, [] { return false; });
  }
}

}  // namespace focalfleet
