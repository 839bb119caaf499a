// The upload brings each unit of the plan its move: stage, read back, arm, and ask from which
// counts it will begin. A unit that restarted since it was last read may count from elsewhere, and
// would begin its way there. Some units of a bus are uploaded at once, the others wait in order. A
// repeat of a move is bounded; a unit that still refuses is reported to the caller with the reason.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "fleet/coordinate/bus_view.h"
#include "fleet/coordinate/coordination.h"
#include "fleet/coordinate/round.h"
#include "protocol/wire/frame_bits.h"

namespace focalfleet {

class Upload {
 public:
  /// `round` outlives this.
  Upload(const Coordination& fleet, Round* round);

  /// The unit waits for its turn. Pre: it has a move in the round.
  void Add(PositionerIndex i);
  /// Adds to `upload` the bits and the time that the waiting units will take.
  void Predict(UploadView* upload);
  /// Begins with as many waiting units as their buses have room for.
  void Pump();
  /// Sends the unit its move, and asks for the read-back.
  void Send(PositionerIndex i);
  /// Asks the unit to arm where its read-back is right, and sends the move again where it is not.
  /// The result says why the unit fails; none: it does not.
  [[nodiscard]] std::optional<std::string> OnConfirm(PositionerIndex i, const ConfirmReply& reply);
  /// Asks the unit for its counts where it has armed. The result is as above.
  [[nodiscard]] std::optional<std::string> OnArm(PositionerIndex i, const ArmReply& reply);
  /// The unit holds its move where it is armed and counts as it is known to. The result is as
  /// above.
  [[nodiscard]] std::optional<std::string> OnProgress(PositionerIndex i,
                                                      const ProgressReply& reply);
  /// The unit has no part in the round any more.
  void Leave(PositionerIndex i);
  [[nodiscard]] bool IsOver() const {
    return round_.count(Part::kWaiting) == 0 && round_.count(Part::kUploading) == 0;
  }
  /// Adds to `upload` the time that it took.
  void Measure(UploadView* upload);
  /// No unit waits any more.
  void DropWaiting();
  void Clear();

 private:
  struct BusUpload {
    std::deque<PositionerIndex> waiting;
    std::uint32_t uploading = 0;  // units
  };

  [[nodiscard]] StagedMove StagedMoveOf(PositionerIndex i) const;
  /// The answer of a unit that is armed and counts as it is known to.
  [[nodiscard]] ProgressReply ArmedProgressOf(PositionerIndex i) const;
  /// Appends the frames that the host stages to `staged`; returns the bits of the rest.
  std::uint32_t BitsOf(PositionerIndex i, std::vector<CanFrame>* staged) const;
  [[nodiscard]] BusUpload& bus_of(PositionerIndex i) { return buses_[fleet_.units[i].bus]; }

  const Coordination fleet_;
  Round& round_;
  std::vector<BusUpload> buses_;
};

}  // namespace focalfleet
