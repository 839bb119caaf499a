// Messages of a plane as bytes, for the body of a DDS sample. The bytes are an agreement between
// daemons of one format; the envelope (PlaneMessage in focalfleet.idl) has its number, and a daemon
// of another format is refused with that reason. Any bytes give a message or an error.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "fleet/plane/plane_messages.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// Grows whenever a message changes. Sectors are upgraded one at a time only between versions of
/// the same format.
inline constexpr std::uint8_t kPlaneFormat = 3;

std::string Encode(const PlaneOrder& order);
std::string Encode(const SectorReport& report);
std::string Encode(const BorderNews& news);

/// Errors, of all three: kInvalid: the bytes are no such message, or a code or a list in it is
/// beyond its limit.
Result<PlaneOrder> DecodePlaneOrder(std::string_view bytes);
Result<SectorReport> DecodeSectorReport(std::string_view bytes);
Result<BorderNews> DecodeBorderNews(std::string_view bytes);

}  // namespace focalfleet
