// CameraDds reaches a camera through two DDS topics (daemon/dds/focalfleet.idl). The daemon asks on
// focalfleet/exposure_request; the camera answers on focalfleet/exposure.
//
// Samples sent before the daemon listened are never received. Samples are checked by the rules for
// files (CheckSpots). Cyclone has already dropped, without a message, samples that are no Exposure
// at all. Until the domain can be joined no exposure is taken, and the answer gives the reason.
//
// With new credentials a further participant joins beside the present one. Requests go to the
// newest participant that the camera knows, and exposures are taken from all. A participant leaves
// at the second request to a newer one: the answer to the first may still come to the older one. A
// participant is not asked any more once its credentials have ended: DDS has cut it off.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "daemon/camera/camera_port.h"
#include "daemon/dds/late_join.h"
#include "daemon/dds/status_publisher.h"

namespace focalfleet {

class CameraDds : public CameraPort {
 public:
  struct Options {
    DdsOptions dds;
    SensorLimits sensor;
    std::function<void(const std::string& trouble)> tell = [](const std::string&) {};  // as
                                                                                       // LateJoin's
    std::chrono::milliseconds rejoin_period{5000};
    std::function<WallTime()> now = &WallTime::Now;
  };
  explicit CameraDds(Options options);
  ~CameraDds() override;

  Status Request(std::uint64_t id, WallTime since) override;
  Result<std::optional<Exposure>> Take() override;
  void Renew(WallTime end) override;

 private:
  class Impl;
  /// The latest exposures by the times at which the camera sent them. Each participant receives
  /// the same ones.
  class Arrivals {
   public:
    /// False: it is known already.
    bool Add(std::int64_t sent_ns);

   private:
    std::array<std::int64_t, 32> sent_ns_{};
    std::size_t next_ = 0;
  };
  struct Member {
    std::unique_ptr<LateJoin<Impl>> joined;
    WallTime end{std::numeric_limits<std::int64_t>::max()};  // of its credentials, once known
    /// 2: a camera is there. 1: the domain is joined.
    [[nodiscard]] int rank() const;
  };
  [[nodiscard]] Member Join() const;

  Options options_;
  std::mutex mutex_;                       // guards all below
  std::vector<Member> members_;            // the oldest first; never empty
  const LateJoin<Impl>* asked_ = nullptr;  // by the last request
  Arrivals arrived_;
};

}  // namespace focalfleet
