#include "daemon/soak/answer_faults.h"

#include <iterator>

namespace focalfleet::soak {

using enum FaultSite;

void LetAnswerWrongly(FaultSite site, UnitId unit, Rng* rng, sim::UnitFaults* faults) {
  constexpr Function kIgnored[] = {Function::kConfirm, Function::kArm,    Function::kStageBegin,
                                   Function::kStatus,  Function::kVector, Function::kProgress,
                                   Function::kHome,    Function::kClock};
  constexpr Function kRefused[] = {Function::kConfirm, Function::kArm, Function::kHome,
                                   Function::kParameterWrite};
  switch (site) {
    case kUnitSilent:
      faults->silent = true;
      break;
    case kUnitDeaf:
      faults->deaf = true;
      break;
    case kUnitLate:
      faults->late = Milliseconds(1 + static_cast<std::int64_t>(rng->Below(3000)));
      break;
    case kUnitCopies:
      faults->copies = static_cast<std::uint8_t>(2 + rng->Below(4));
      break;
    case kUnitWrongDigest:
      faults->wrong_digest = true;
      break;
    case kUnitMuteDone:
      faults->mute_done = true;
      break;
    case kUnitIgnores:
      faults->ignores = kIgnored[rng->Below(std::size(kIgnored))];
      break;
    case kUnitRefuses:
      faults->refuses = {kRefused[rng->Below(std::size(kRefused))],
                         static_cast<Answer>(1 + rng->Below(7))};
      break;
    case kUnitStaleSequence:
      faults->stale_sequence = true;
      break;
    case kUnitFaultInMotion:
      faults->in_motion = {Milliseconds(static_cast<std::int64_t>(rng->Below(6000))),
                           static_cast<FaultCode>(1 + rng->Below(5)),
                           rng->Below(2) == 0 ? Axis::kTheta : Axis::kPhi};
      break;
    case kUnitForeign:
      faults->foreign_serial = SerialNumber{900'000 + unit.value};
      break;
    case kUnitSerialZero:
      faults->foreign_serial = SerialNumber{0};
      break;
    default:
      break;
  }
}

std::optional<sim::UnitFaults::Kind> KindOf(FaultSite site) {
  using Kind = sim::UnitFaults::Kind;
  switch (site) {
    case kUnitSilent:
    case kUnitIntermittent:
      return Kind::kSilent;
    case kUnitDeaf:
      return Kind::kDeaf;
    case kUnitLate:
      return Kind::kLate;
    case kUnitCopies:
      return Kind::kCopies;
    case kUnitWrongDigest:
      return Kind::kWrongDigest;
    case kUnitMuteDone:
      return Kind::kMuteDone;
    case kUnitIgnores:
      return Kind::kIgnores;
    case kUnitRefuses:
      return Kind::kRefuses;
    case kUnitStaleSequence:
      return Kind::kStaleSequence;
    case kUnitFaultInMotion:
      return Kind::kInMotion;
    case kUnitForeign:
    case kUnitSerialZero:
      return Kind::kForeignSerial;
    default:
      return std::nullopt;
  }
}

}  // namespace focalfleet::soak
