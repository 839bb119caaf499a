#include "daemon/camera/camera_folder.h"

#include <algorithm>
#include <array>
#include <utility>

#include "daemon/camera/exposure_bytes.h"
#include "fleet/files/spots_file.h"
#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

constexpr const char* kRequest = "request.json";

constexpr std::array<std::string_view, 4> kSpotEndings = {".csv", ".fits", ".fit", ".fts"};
constexpr std::array<std::string_view, 28> kForeignEndings = {
    ".gz",  ".bz2",  ".xz",  ".zst", ".z",   ".fz",  ".lz4",  ".zip",    ".7z",      ".tar",
    ".tgz", ".ecsv", ".txt", ".dat", ".tsv", ".asc", ".xml",  ".vot",    ".votable", ".h5",
    ".hdf", ".hdf5", ".npy", ".npz", ".xls", ".ods", ".xlsx", ".parquet"};

std::string LowerCase(std::string_view name) {
  std::string lower(name);
  for (char& c : lower)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return lower;
}

template <std::size_t kCount>
bool EndsInOneOf(std::string_view name, const std::array<std::string_view, kCount>& endings) {
  return std::ranges::any_of(endings, [&](std::string_view end) { return name.ends_with(end); });
}

/// `name`, shortened so that ".reason" still fits behind it.
std::string ReasonName(const std::string& name) {
  constexpr std::size_t kStemMax = 240;
  return name.substr(0, kStemMax) + ".reason";
}

}  // namespace

CameraFile KindOfName(std::string_view name) {
  if (name.starts_with('.')) return CameraFile::kNotOurs;
  const std::string lower = LowerCase(name);
  std::string_view unpacked = lower;
  if (unpacked.ends_with(".gz")) unpacked.remove_suffix(3);
  if (EndsInOneOf(unpacked, kSpotEndings)) return CameraFile::kSpots;
  return EndsInOneOf(lower, kForeignEndings) ? CameraFile::kForeign : CameraFile::kNotOurs;
}

Result<CameraFolder::Folders> CameraFolder::OpenAll(const std::string& path, Place place) {
  FOCALFLEET_TRY_ASSIGN(GuardedFolder requests, GuardedFolder::Open(path));
  FOCALFLEET_TRY_ASSIGN(GuardedFolder files, place == Place::kDropPlace
                                                 ? requests.Subfolder("drop")
                                                 : GuardedFolder::Open(path));
  FOCALFLEET_TRY_ASSIGN(GuardedFolder taken, requests.Subfolder("taken"));
  FOCALFLEET_TRY_ASSIGN(GuardedFolder refused, requests.Subfolder("refused"));
  return Folders{std::move(requests), std::move(files), std::move(taken), std::move(refused)};
}

Result<std::unique_ptr<CameraFolder>> CameraFolder::Open(std::string path, SensorLimits sensor,
                                                         Place place) {
  auto folders = OpenAll(path, place);
  if (!folders)
    return Fail(folders.error().code, "camera folder " + path + ": " + folders.error().text);
  std::unique_ptr<CameraFolder> folder(
      new CameraFolder(std::move(path), std::move(*folders), sensor, place));
  const auto names = folder->folders_.files.Names(limits::kCameraFiles);
  // A folder that is too full is reported when the first exposure is due: a fleet moves without it.
  if (!names && names.error().code == ErrorCode::kFull) return folder;
  if (!names) return tl::unexpected(names.error());
  for (const std::string& name : *names)
    if (KindOfName(name) != CameraFile::kNotOurs)
      folder->Refuse(name, "it was there before the daemon asked for anything");
  return folder;
}

Status CameraFolder::Request(std::uint64_t id, WallTime since) {
  // The path may lead elsewhere by now: the folder may have been cleared up or mounted anew.
  FOCALFLEET_TRY_ASSIGN(folders_, OpenAll(path_, place_));
  return folders_.requests.Write(kRequest, "{\"exposure\": " + std::to_string(id) +
                                               ", \"since_utc\": \"" + UtcOf(since.ns) + "\"}\n");
}

Result<std::optional<Exposure>> CameraFolder::Take() {
  FOCALFLEET_TRY_ASSIGN(const std::string name, NextFile());
  if (name.empty()) return std::optional<Exposure>();
  const GuardedFolder& folder = folders_.files;
  auto exposure = [&]() -> Result<Exposure> {
    if (KindOfName(name) == CameraFile::kForeign)
      return Fail(ErrorCode::kInvalid,
                  folder.Shown(name) +
                      ": spots come as .csv, .fits, .fit or .fts, or as these with .gz behind");
    FOCALFLEET_TRY_ASSIGN(std::string bytes, folder.Read(name, limits::kExposureBytes));
    return ParseExposure(std::move(bytes), folder.Shown(name), sensor_);
  }();
  if (!exposure) {
    if (!folder.IdentityOf(name)) return std::optional<Exposure>();  // the camera took it back
    Refuse(name, exposure.error().text);
    return tl::unexpected(exposure.error());
  }
  SetAside(name, folders_.taken);
  return std::optional(std::move(*exposure));
}

/// The first file by name, so that the files of a camera that counts are taken in its order. Empty:
/// there is none.
Result<std::string> CameraFolder::NextFile() {
  FOCALFLEET_TRY_ASSIGN(const auto names, folders_.files.Names(limits::kCameraFiles));
  std::erase_if(stays_, [&](const auto& stays) {
    return !std::binary_search(names.begin(), names.end(), stays.first);
  });
  for (const std::string& name : names) {
    if (KindOfName(name) == CameraFile::kNotOurs) continue;
    const auto stays = stays_.find(name);
    if (stays != stays_.end() && folders_.files.IdentityOf(name) == stays->second) continue;
    return name;
  }
  return std::string();
}

// A file that cannot be moved would be read for ever, so it is remembered.
void CameraFolder::SetAside(const std::string& name, const GuardedFolder& folder) {
  const auto identity = folders_.files.IdentityOf(name);
  stays_.erase(name);
  if (!folders_.files.Move(name, folder) && identity) stays_.emplace(name, *identity);
}

void CameraFolder::Refuse(const std::string& name, const std::string& reason) {
  SetAside(name, folders_.refused);
  [[maybe_unused]] const Status said = folders_.refused.Write(ReasonName(name), reason + "\n");
}

}  // namespace focalfleet
