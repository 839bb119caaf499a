// A camera behind a folder: we ask by request.json, it answers by a file of spots.
//
//   request.json   {"exposure": 12, "since_utc": "2026-11-22T03:04:05.678Z"}, replaced as a whole
//   <name>.csv     one exposure (docs/files.md), or <name>.fits (.fit, .fts), or these packed as
//                  <name>.csv.gz; to be put there as a whole, too: written under an ending such as
//                  .part, and renamed
//   taken/         where we move each file that we have read
//   refused/       ... and each that is no exposure, with <file>.reason beside it
//
// Tables and archives that are none of these are refused by their ending. All other names are left
// alone: they may be what a camera is writing.
//
// Files that lie there when the daemon starts are set aside as refused: they answer nothing.
//
// The camera may be another user, and broken or hostile (daemon/files/guarded_folder.h). Nothing of
// it is removed: what cannot be moved stays, and is looked at again when it has changed.
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
  kForeign,  // people take it for one: told, not passed over
  kNotOurs,
};
CameraFile KindOfName(std::string_view name);

class CameraFolder : public CameraPort {
 public:
  /// Makes the folder where it is missing. Errors: kUnavailable, names it.
  static Result<std::unique_ptr<CameraFolder>> Open(std::string path, SensorLimits sensor);

  Status Request(std::uint64_t id, WallTime since) override;
  Result<std::optional<Exposure>> Take() override;

 private:
  struct Folders {
    GuardedFolder camera;
    GuardedFolder taken;
    GuardedFolder refused;
  };
  static Result<Folders> OpenAll(const std::string& path);

  CameraFolder(std::string path, Folders folders, SensorLimits sensor)
      : path_(std::move(path)), folders_(std::move(folders)), sensor_(sensor) {}
  Result<std::string> NextFile();
  void SetAside(const std::string& name, const GuardedFolder& folder);
  void Refuse(const std::string& name, const std::string& reason);

  std::string path_;
  Folders folders_;
  SensorLimits sensor_;
  std::map<std::string, FileIdentity> stays_;  // could not be moved
};

}  // namespace focalfleet
