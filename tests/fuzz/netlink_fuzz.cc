// The input is any bytes as the kernel's answer about a CAN interface. They must give a link, an
// acknowledgement or a reason. Whatever lengths the answer claims, nothing is read past the end
// (the sanitizers check that), and all values stand in bounds.
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "daemon/ports/can_netlink.h"
#include "protocol/base/check.h"

namespace focalfleet {
namespace {

void TryBytes(const std::uint8_t* data, std::size_t size) {
  std::vector<std::byte> bytes(size);
  if (size > 0) std::memcpy(bytes.data(), data, size);
  if (const auto link = ReadLink(bytes)) {
    FOCALFLEET_CHECK(!link->state || *link->state <= ControllerState::kSleeping);
    FOCALFLEET_CHECK(link->kind.size() <= size && link->kind.find('\0') == std::string::npos);
  } else {
    FOCALFLEET_CHECK(!link.error().text.empty());
  }
  const auto acknowledged = ReadAcknowledgement(bytes);
  FOCALFLEET_CHECK(acknowledged || !acknowledged.error().text.empty());
}

}  // namespace
}  // namespace focalfleet

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  focalfleet::TryBytes(data, size);
  return 0;
}
