#include "daemon/camera/camera_folder.h"

#include <filesystem>
#include <utility>

#include "daemon/camera/spots_fits.h"
#include "daemon/files/text_file.h"
#include "fleet/files/spots_file.h"

namespace focalfleet {
namespace fs = std::filesystem;

Result<std::unique_ptr<CameraFolder>> CameraFolder::Open(std::string path, SensorLimits sensor) {
  std::error_code failed;
  for (const char* part : {"", "taken", "refused"}) {
    fs::create_directories(fs::path(path) / part, failed);
    if (failed)
      return Fail(ErrorCode::kUnavailable,
                  "camera folder " + path + " cannot be made: " + failed.message());
  }
  std::unique_ptr<CameraFolder> folder(new CameraFolder(std::move(path), sensor));
  for (std::string name = folder->NextFile(); !name.empty(); name = folder->NextFile())
    folder->Refuse(name, "it was there before the daemon asked for anything");
  return folder;
}

Status CameraFolder::Request(std::uint64_t id, WallTime since) {
  return WriteFileAtomically(
      path_ + "/request.json",
      "{\"exposure\": " + std::to_string(id) + ", \"since_utc\": \"" + UtcOf(since.ns) + "\"}\n");
}

Result<std::optional<Exposure>> CameraFolder::Take() {
  const std::string name = NextFile();
  if (name.empty()) return std::optional<Exposure>();
  const std::string file = path_ + "/" + name;
  Result<Exposure> exposure = [&]() -> Result<Exposure> {
    if (name.ends_with(".fits")) return ReadSpotsFits(file, sensor_);
    FOCALFLEET_TRY_ASSIGN(const std::string text, ReadTextFile(file));
    return ReadSpots(text, file, sensor_);
  }();
  if (!exposure) {
    Refuse(name, exposure.error().text);
    return tl::unexpected(exposure.error());
  }
  SetAside(name, "taken");
  return std::optional(std::move(*exposure));
}

/// The first by name, so that a camera that counts is taken in its order; empty: none.
std::string CameraFolder::NextFile() const {
  std::string first;
  std::error_code failed;
  for (fs::directory_iterator entry(path_, failed), end; !failed && entry != end;
       entry.increment(failed)) {
    const std::string name = entry->path().filename().string();
    if (!name.ends_with(".csv") && !name.ends_with(".fits")) continue;
    if (first.empty() || name < first) first = name;
  }
  return first;
}

// A file that cannot be moved would be read for ever: it is removed then.
void CameraFolder::SetAside(const std::string& name, const std::string& folder) const {
  std::error_code failed;
  fs::rename(fs::path(path_) / name, fs::path(path_) / folder / name, failed);
  if (failed) fs::remove_all(fs::path(path_) / name, failed);
}

void CameraFolder::Refuse(const std::string& name, const std::string& reason) const {
  SetAside(name, "refused");
  [[maybe_unused]] const Status said =
      WriteFileAtomically(path_ + "/refused/" + name + ".reason", reason + "\n");
}

}  // namespace focalfleet
