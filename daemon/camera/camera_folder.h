// CameraFolder reaches a camera through a folder. The daemon asks by request.json; the camera
// answers by a file of spots.
//
//   request.json   {"exposure": 12, "since_utc": "2026-11-22T03:04:05.678Z"}, replaced as a whole
//   <name>.csv     one exposure (docs/files.md), or <name>.fits (.fit, .fts), or these packed as
//                  <name>.csv.gz; also to be put there as a whole: written under an ending such as
//                  .part, and renamed
//   taken/         the daemon moves each file here that it has read
//   refused/       and each file here that is no exposure, with <file>.reason beside it
//
// Tables and archives with any other ending are refused by their ending. All other names are left
// alone: a camera may be writing them.
//
// Files that lie in the folder when the daemon starts are set aside as refused, since they answer
// no request.
//
// With a drop place the camera puts its files into the subfolder drop/ instead, and needs to write
// nowhere else: requests and what was taken are then the daemon's alone.
//
// The camera may run as another user, and may be broken or hostile (daemon/files/guarded_folder.h).
// Nothing of it is deleted. A file that cannot be moved stays, and is looked at again when it has
// changed.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <string_view>

#include "daemon/camera/camera_port.h"
#include "daemon/files/guarded_folder.h"

namespace focalfleet {

enum class CameraFile : std::uint8_t {
  kSpots,
  kForeign,  // easily mistaken for an exposure: reported, not skipped
  kNotOurs,
};
CameraFile KindOfName(std::string_view name);

class CameraFolder : public CameraPort {
 public:
  /// Where the camera puts its files.
  enum class Place : std::uint8_t { kFolder, kDropPlace };

  /// Makes the folder where it is missing, and its drop place.
  /// Errors: kUnavailable, with the folder's path.
  static Result<std::unique_ptr<CameraFolder>> Open(std::string path, SensorLimits sensor,
                                                    Place place = Place::kFolder);

  Status Request(std::uint64_t id, WallTime since) override;
  Result<std::optional<Exposure>> Take() override;

 private:
  struct Folders {
    GuardedFolder requests;
    GuardedFolder files;  // from the camera: the same folder, or the drop place
    GuardedFolder taken;
    GuardedFolder refused;
  };
  static Result<Folders> OpenAll(const std::string& path, Place place);

  CameraFolder(std::string path, Folders folders, SensorLimits sensor, Place place)
      : path_(std::move(path)), folders_(std::move(folders)), sensor_(sensor), place_(place) {}
  Result<std::string> NextFile();
  void SetAside(const std::string& name, const GuardedFolder& folder);
  void Refuse(const std::string& name, const std::string& reason);

  std::string path_;
  Folders folders_;
  SensorLimits sensor_;
  Place place_ = Place::kFolder;
  std::map<std::string, FileIdentity> stays_;  // files that could not be moved
};

}  // namespace focalfleet
