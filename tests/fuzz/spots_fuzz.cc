// The first byte of the input picks the use. Any bytes are read as one exposure of the camera, as
// CSV or as a file in the camera's folder, or as the fiducials' table. They must give an exposure
// that obeys all rules or an error that names the file, never more. An exposure that was read and
// is written again reads back the same.
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

/// A folder on a file system in memory where there is one; gone when the process ends.
class Scratch {
 public:
  Scratch() {
    const char* where = access("/dev/shm", W_OK) == 0 ? "/dev/shm" : "/tmp";
    std::string name = std::string(where) + "/spots_fuzz.XXXXXX";
    FOCALFLEET_CHECK(mkdtemp(name.data()) != nullptr);
    folder_ = name;
  }
  ~Scratch() {
    unlink((folder_ + "/again.fits").c_str());
    rmdir(folder_.c_str());
  }
  [[nodiscard]] std::string File(const char* name) const { return folder_ + "/" + name; }

 private:
  std::string folder_;
};

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

/// Tries bytes as FITS, or as any file of a camera, packed by gzip, too.
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
