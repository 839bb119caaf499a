// A camera behind a folder: we ask by request.json, it answers by a file <name>.csv or <name>.fits.
//
//   request.json   {"exposure": 12, "since_utc": "2026-11-22T03:04:05.678Z"}, replaced as a whole
//   <name>.csv     one exposure (docs/files.md); to be put there as a whole, too: written under
//                  another ending, and renamed
//   taken/         where we move each file that we have read
//   refused/       ... and each that is no exposure, with <file>.reason beside it
//
// Files that lie there when the daemon starts are set aside as refused: they answer nothing.
#pragma once

#include <memory>
#include <string>

#include "daemon/camera/camera_port.h"

namespace focalfleet {

class CameraFolder : public CameraPort {
 public:
  /// Makes the folder where it is missing. Errors: kUnavailable, names it.
  static Result<std::unique_ptr<CameraFolder>> Open(std::string path, SensorLimits sensor);

  Status Request(std::uint64_t id, WallTime since) override;
  Result<std::optional<Exposure>> Take() override;

 private:
  CameraFolder(std::string path, SensorLimits sensor) : path_(std::move(path)), sensor_(sensor) {}
  void SetAside(const std::string& name, const std::string& folder) const;
  [[nodiscard]] std::string NextFile() const;
  void Refuse(const std::string& name, const std::string& reason) const;

  std::string path_;
  SensorLimits sensor_;
};

}  // namespace focalfleet
