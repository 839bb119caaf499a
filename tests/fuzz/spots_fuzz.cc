// Any bytes as one exposure of the camera, as CSV or as whatever lies in the camera's folder by the
// first byte, or as the fiducials' table: an exposure that holds to all rules or an error that
// names the file, never more. What was read and is written again reads back the same.
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "daemon/camera/exposure_bytes.h"
#include "daemon/camera/spots_fits.h"
#include "fleet/files/fiducials_file.h"
#include "fleet/files/spots_file.h"
#include "protocol/base/check.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using test::ScratchFolder;

constexpr SensorLimits kSensor{11'000, 11'000};

void ExpectSame(const Exposure& one, const Result<Exposure>& other) {
  FOCALFLEET_CHECK(other.has_value());
  FOCALFLEET_CHECK(other->id == one.id && other->taken_unix_ns == one.taken_unix_ns);
  FOCALFLEET_CHECK(ContentOf(*other) == ContentOf(one));
}

void TryCsv(std::string_view text) {
  const auto exposure = ReadSpots(text, "fuzz.csv", kSensor);
  if (!exposure) {
    FOCALFLEET_CHECK(exposure.error().text.find("fuzz.csv") == 0);
    return;
  }
  FOCALFLEET_CHECK(CheckSpots(*exposure, kSensor).has_value());
  ExpectSame(*exposure, ReadSpots(WriteSpots(*exposure), "again.csv", kSensor));
}

/// FITS, or whatever a camera may hand over, packed by gzip, too.
void TryBytes(std::string_view bytes) {
  // In memory, where a file system in memory can be written.
  static const ScratchFolder scratch(access("/dev/shm", W_OK) == 0 ? "/dev/shm" : "/tmp");
  const auto exposure = ParseExposure(std::string(bytes), "in.fits", kSensor);
  if (!exposure) {
    FOCALFLEET_CHECK(exposure.error().text.find("in.fits") == 0);
    return;
  }
  FOCALFLEET_CHECK(CheckSpots(*exposure, kSensor).has_value());
  FOCALFLEET_CHECK(CheckExposureId(exposure->id).has_value());
  FOCALFLEET_CHECK(WriteSpotsFits(scratch / "again.fits", *exposure).has_value());
}

void TryFiducials(std::string_view text) {
  const auto fiducials = ReadFiducials(text, "fuzz.csv");
  FOCALFLEET_CHECK(fiducials || fiducials.error().text.find("fuzz.csv") == 0);
}

}  // namespace
}  // namespace focalfleet

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string_view rest(static_cast<const char*>(static_cast<const void*>(data + 1)),
                              size - 1);
  constexpr void (*kReaders[])(std::string_view) = {focalfleet::TryCsv, focalfleet::TryBytes,
                                                    focalfleet::TryFiducials};
  kReaders[data[0] % 3](rest);
  return 0;
}
