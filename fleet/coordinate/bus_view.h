// The view of a bus is what the coordinator publishes of it: link, load, counts of frames and bits,
// and the cost of uploading moves.
#pragma once

#include <cstdint>

#include "protocol/link/frame_port.h"

namespace focalfleet {

/// The cost of getting the moves of a configuration onto the wire. Frames without which a unit is
/// not armed are counted: stage_begin, stage_segment, confirm and arm with their answers. Bits are
/// of the nominal bit rate; CAN FD counts by its time.
struct UploadView {
  // Predictions are made before the first frame is sent. They are exact where each frame is sent
  // once and groups are as full as can be.
  std::uint64_t bits_predicted = 0;
  std::uint64_t bits = 0;  // as they passed: repeats and late moves included
  double predicted_s = 0;  // bits_predicted by the bit rate; of all buses the longest
  double measured_s = 0;   // first frame released to last unit armed; of all buses the longest
};

struct BusView {
  LinkState link = LinkState::kUp;
  std::uint64_t frames_sent = 0;
  std::uint64_t frames_received = 0;
  std::uint64_t bits = 0;  // both directions, exact
  std::uint64_t malformed = 0;
  std::uint64_t retries = 0;
  double load = 0;      // of the last second
  double load_max = 0;  // highest second since the configuration began
  UploadView upload;    // of the configuration, all rounds
};

}  // namespace focalfleet
