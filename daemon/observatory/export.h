// The way back: a configuration, and the fibres as they were measured, in the form that the
// project's own pipeline reads. The folder of an import knows the units and their other names.
#pragma once

#include <string>

#include "protocol/base/result.h"

namespace focalfleet::observatory {

struct ExportRequest {
  std::string folder;   // of the import
  std::string targets;  // empty: the folder's, where it has one
  std::string plan;     // empty: units are where the state has them
  std::string state;    // where the plan begins; empty: the folder's
  std::string fibres;   // as `measurements --out` writes them; empty: not measured
  std::string out;
};

/// DESI: a FITS table FIBERASSIGN; with fibres a table DATA with their places and distances.
Result<std::size_t> ExportDesi(const ExportRequest& request);
/// SDSS-V: a yanny file with the rows FIBERMAP of a confSummary, one for each of a robot's fibres.
Result<std::size_t> ExportSdss(const ExportRequest& request);
/// PFS: a FITS table DESIGN; with fibres a table CONFIG with pfiCenter.
Result<std::size_t> ExportPfs(const ExportRequest& request);
/// MOONS: lines of positioner, R, THETA, parity, priority.
Result<std::size_t> ExportMoons(const ExportRequest& request);

// All return the number of units that the file names. Errors: as ReadTables and the writers;
// kInvalid: a unit that the folder does not have, an import of another project.

}  // namespace focalfleet::observatory
