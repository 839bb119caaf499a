// The motions of the newest plans, kept for pages: of the last preview, and of configurations as
// far back as a bound of bytes allows. The planner's thread puts them in, threads of the HTTP
// server take them out, and the core has no part in it. A plan that was given up, or that a stop
// cut short, is kept like any other; the store says how each unit's move ended.
//
// With a folder the motions of configurations outlast the daemon: a file each, named
// CONFIGURATION.NUMBER.motion. The planner waits for no disk, so a file is not made durable. A file
// that a power cut tore is known by its length and left out. A file that cannot be written costs
// the motion after a restart and nothing else.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

namespace focalfleet {

class KeptPlans {
 public:
  using Motion = std::shared_ptr<const std::string>;  // plan_motion.h

  /// 48 MB are a night of 100 configurations of 5000 units.
  static constexpr std::size_t kBytesMax = std::size_t{48} << 20;

  explicit KeptPlans(std::size_t bytes_max = kBytesMax) : bytes_max_(bytes_max) {}

  /// Takes over what the folder has, and keeps motions there from now on; made if missing. Files
  /// that are no motions are left alone. Pre: nothing was put in yet.
  void KeepIn(const std::string& folder);

  /// The preview takes the place of the one before it. `plan` is the number that its asker got.
  void PutPreview(std::uint64_t plan, std::string motion);
  /// The oldest go until all fit. A plan that does not fit alone is not kept.
  void Put(std::uint64_t configuration, std::string motion);

  /// Null: another preview came since, or none did.
  [[nodiscard]] Motion Preview(std::uint64_t plan) const;
  /// The plans of a configuration, the oldest first; empty: they are no longer kept.
  [[nodiscard]] std::vector<Motion> Of(std::uint64_t configuration) const;

 private:
  struct Kept {
    std::uint64_t configuration = 0;
    std::size_t bytes = 0;
    Motion motion;     // null: it lies in the file alone
    std::string path;  // empty: there is no file
  };

  void DropBeyondBound();
  [[nodiscard]] std::string PathOf(std::uint64_t configuration) const;

  const std::size_t bytes_max_;
  mutable std::mutex mutex_;
  // ---- under the mutex
  std::string folder_;  // empty: none
  std::deque<Kept> plans_;
  std::size_t bytes_ = 0;  // of plans_
  std::uint64_t preview_plan_ = 0;
  Motion preview_;
};

}  // namespace focalfleet
