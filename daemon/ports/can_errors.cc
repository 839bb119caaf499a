#include "daemon/ports/can_errors.h"

#include <linux/can/error.h>

#include <algorithm>
#include <numeric>

namespace focalfleet {
namespace {

constexpr std::uint8_t kWarningBits = CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING;
constexpr std::uint8_t kPassiveBits = CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE;
constexpr std::uint8_t kOverrunBits = CAN_ERR_CRTL_RX_OVERFLOW | CAN_ERR_CRTL_TX_OVERFLOW;

bool IsAbout(const can_frame& error, std::uint32_t classes) {
  return (error.can_id & classes) != 0;
}

}  // namespace

can_err_mask_t ErrorsOfInterest() {
  return CAN_ERR_CRTL | CAN_ERR_BUSOFF | CAN_ERR_RESTARTED | CAN_ERR_TX_TIMEOUT | CAN_ERR_ACK |
         CAN_ERR_PROT | CAN_ERR_BUSERROR;
}

std::optional<LinkState> LinkStateOf(const can_frame& error) {
  if (IsAbout(error, CAN_ERR_BUSOFF)) return LinkState::kOff;
  if (IsAbout(error, CAN_ERR_RESTARTED)) return LinkState::kUp;
  if (!IsAbout(error, CAN_ERR_CRTL)) return std::nullopt;
  const std::uint8_t controller = error.data[1];
  if ((controller & kPassiveBits) != 0) return LinkState::kPassive;
  if ((controller & (CAN_ERR_CRTL_ACTIVE | kWarningBits)) != 0) return LinkState::kUp;
  return std::nullopt;
}

bool IsWarning(const can_frame& error) {
  return IsAbout(error, CAN_ERR_CRTL) && !IsAbout(error, CAN_ERR_BUSOFF | CAN_ERR_RESTARTED) &&
         (error.data[1] & kWarningBits) != 0 && (error.data[1] & kPassiveBits) == 0;
}

void ErrorTally::Note(const can_frame& error, std::uint64_t times) {
  const auto count = [&](Kind kind, bool seen) { counts_[kind] += seen ? times : 0u; };
  const bool violation = IsAbout(error, CAN_ERR_PROT);
  const std::uint8_t how = violation ? error.data[2] : std::uint8_t{0};
  const bool crc = violation && (error.data[3] == CAN_ERR_PROT_LOC_CRC_SEQ ||
                                 error.data[3] == CAN_ERR_PROT_LOC_CRC_DEL);
  constexpr std::uint8_t kBitErrors = CAN_ERR_PROT_BIT | CAN_ERR_PROT_BIT0 | CAN_ERR_PROT_BIT1;
  constexpr std::uint8_t kNamed = kBitErrors | CAN_ERR_PROT_STUFF | CAN_ERR_PROT_FORM;
  const bool acknowledgement = IsAbout(error, CAN_ERR_ACK);
  count(kAcknowledgement, acknowledgement);
  count(kCrc, crc);
  count(kBit, (how & kBitErrors) != 0);
  count(kStuff, (how & CAN_ERR_PROT_STUFF) != 0);
  count(kForm, (how & CAN_ERR_PROT_FORM) != 0);
  count(kOverrun, IsAbout(error, CAN_ERR_CRTL) && (error.data[1] & kOverrunBits) != 0);
  count(kOther,
        IsAbout(error, CAN_ERR_TX_TIMEOUT) || (IsAbout(error, CAN_ERR_PROT | CAN_ERR_BUSERROR) &&
                                               (how & kNamed) == 0 && !acknowledgement && !crc));
}

std::string ErrorTally::Causes() const {
  static constexpr const char* kNames[kKinds] = {"no acknowledgement", "bit error", "stuff error",
                                                 "form error",         "CRC error", "overrun",
                                                 "other bus error"};
  constexpr std::size_t kNamedMax = 3;
  std::array<std::size_t, kKinds> order{};
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(
      order, [this](std::size_t a, std::size_t b) { return counts_[a] > counts_[b]; });
  std::string text;
  for (std::size_t i = 0; i < kNamedMax && counts_[order[i]] > 0; ++i)
    text += (i > 0 ? ", " : "") + std::string(kNames[order[i]]);
  return text;
}

}  // namespace focalfleet
