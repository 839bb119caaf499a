#include "daemon/dds/credential_watch.h"

#include <condition_variable>
#include <mutex>
#include <utility>

namespace focalfleet {

CredentialWatch::CredentialWatch(Options options)
    : options_(std::move(options)),
      used_(CredentialState(options_.folder)),
      seen_(used_),
      thread_([this](const std::stop_token& stop) {
        std::mutex mutex;
        std::condition_variable_any ended;
        std::unique_lock lock(mutex);
        do {
          Look();
          ended.wait_for(lock, stop, options_.period, [] { return false; });
        } while (!stop.stop_requested());
      }) {}

void CredentialWatch::Look() {
  const auto ends = ReadCredentialEnds(options_.folder);
  const std::string trouble = ends ? "" : ends.error().text;
  if (trouble != trouble_ && !trouble.empty()) options_.tell(trouble);
  trouble_ = trouble;
  // Files in the middle of a change differ from the last look.
  const std::string state = CredentialState(options_.folder);
  const bool settled = state == std::exchange(seen_, state);
  if (!ends) return;
  const WallTime now = options_.now();
  const bool good = ends->front().at_s > now.ns / 1'000'000'000;
  if (settled && good && state != used_) {
    used_ = state;
    options_.renew(std::exchange(used_end_, kNoEnd));
  }
  if (state != used_) return;  // what participants use is no longer there to be read
  used_end_ = {ends->front().at_s * 1'000'000'000};
  if (const auto note = clock_.Look(*ends, now)) options_.note(*note);
}

}  // namespace focalfleet
