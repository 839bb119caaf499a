// The commands import and export: files of other projects into the tables of this one, and back.

#include <fmt/format.h>

#include <map>

#include "daemon/cli/command_line.h"
#include "daemon/observatory/desi.h"
#include "daemon/observatory/export.h"
#include "daemon/observatory/moons.h"
#include "daemon/observatory/pfs.h"
#include "daemon/observatory/sdss.h"

namespace focalfleet::cli {
namespace {

using observatory::Plate;
using observatory::SourceFiles;

struct Project {
  const char* name;
  const char* robots;
  const char* layout;
  Result<Plate> (*read)(const SourceFiles&);
  Result<std::size_t> (*write)(const observatory::ExportRequest&);
  const char* import_example;
  const char* export_example;
};

constexpr Project kProjects[] = {
    {"desi", "DESI", "calibration of the positioners, or the focal plane of desimodel",
     observatory::ReadDesi, observatory::ExportDesi,
     "  focalfleet import desi --layout calib.csv --targets fiberassign.fits.gz --out plate",
     "  focalfleet export desi --import plate --plan plan.csv --out fiberassign.fits"},
    {"sdss", "SDSS-V", "positionerTable.csv and wokCoords.csv, or a proc-fimg file",
     observatory::ReadSdss, observatory::ExportSdss,
     "  focalfleet import sdss --layout positionerTable.csv wokCoords.csv --targets "
     "confSummary.par --out plate",
     "  focalfleet export sdss --import plate --plan plan.csv --out confSummary.par"},
    {"pfs", "PFS", "XML files of the modules", observatory::ReadPfs, observatory::ExportPfs,
     "  focalfleet import pfs --layout SC01.xml SC02.xml --targets pfsDesign.fits --fibre-map "
     "fibres.csv --out plate",
     "  focalfleet export pfs --import plate --plan plan.csv --out pfsDesign.fits"},
    {"moons", "MOONS", "configuration file of the positioners (PAF)", observatory::ReadMoons,
     observatory::ExportMoons,
     "  focalfleet import moons --layout positioners.cfg --targets targets.txt --out plate",
     "  focalfleet export moons --import plate --plan plan.csv --out targets.txt"}};

struct ImportOptions {
  const Project* project = nullptr;
  SourceFiles files;
  std::string out;
};

struct ExportOptions {
  const Project* project = nullptr;
  observatory::ExportRequest request;
};

std::size_t DisabledOf(const Plate& plate) {
  return static_cast<std::size_t>(std::ranges::count_if(
      plate.units, [](const observatory::PlateUnit& unit) { return !unit.unit.enabled; }));
}

/// Rows that were left out, by kind and reason; a reason's numbers are behind its colon.
void ReportLeftOut(const Context& context, const Plate& plate, const std::string& folder) {
  if (plate.left_out.empty() || context.quiet || context.json) return;
  std::map<std::pair<std::string, std::string>, std::size_t> count;
  for (const observatory::LeftOut& row : plate.left_out)
    ++count[{row.what, row.reason.substr(0, row.reason.find(':'))}];
  std::string text = fmt::format("focalfleet: {} left out, see {}/left_out.csv:\n",
                                 Count(plate.left_out.size(), "row", "rows"), folder);
  for (const auto& [kind, n] : count)
    text += fmt::format("  {} {}: {}\n", n, kind.first, kind.second);
  Complain(text);
}

ExitCode RunImport(const Context& context, const ImportOptions& options) {
  const auto plate = options.project->read(options.files);
  if (!plate) return Report(context, plate.error());
  if (const Status written = WritePlate(*plate, options.project->name, options.out); !written)
    return Report(context, written.error());
  const std::size_t disabled = DisabledOf(*plate);
  const std::size_t targets = plate->targets ? plate->targets->rows.size() : 0;
  if (context.json) {
    PrintJson({{"project", options.project->name},
               {"units", plate->units.size()},
               {"disabled", disabled},
               {"obstacles", plate->obstacles.size()},
               {"fiducials", plate->fiducials.size()},
               {"targets", targets},
               {"moves", plate->moves.size()},
               {"left_out", plate->left_out.size()},
               {"notes", plate->notes},
               {"out", options.out}});
  }
  if (!context.quiet && !context.json)
    for (const std::string& note : plate->notes) Complain("focalfleet: " + note + "\n");
  ReportLeftOut(context, *plate, options.out);
  Say(context,
      fmt::format("{}: {}, {} of them disabled; {}, {}, {}", options.out,
                  Count(plate->units.size(), "unit", "units"), disabled,
                  Count(targets, "target", "targets"), Count(plate->moves.size(), "move", "moves"),
                  Count(plate->obstacles.size(), "obstacle", "obstacles")));
  const bool none_taken = (!options.files.targets.empty() && targets == 0) ||
                          (!options.files.moves.empty() && plate->moves.empty());
  return none_taken ? ExitCode::kSomeUnserved : ExitCode::kOk;
}

ExitCode RunExport(const Context& context, const ExportOptions& options) {
  const auto rows = options.project->write(options.request);
  if (!rows) return Report(context, rows.error());
  if (context.json)
    PrintJson({{"project", options.project->name}, {"units", *rows}, {"out", options.request.out}});
  Say(context, fmt::format("{}: {}", options.request.out, Count(*rows, "unit", "units")));
  return ExitCode::kOk;
}

CLI::Option* AddFiles(CLI::App* command, const char* name, std::vector<std::string>* files,
                      const std::string& what) {
  return command->add_option(name, *files, what)->type_name("FILE");
}

void AddImportOf(const Project& project, CLI::App* parent, CommandLine* line) {
  CLI::App* command = AddCommand(
      parent, project.name,
      fmt::format("Units, targets, state and moves of {} and robots like it", project.robots)
          .c_str(),
      project.import_example);
  auto options = std::make_shared<ImportOptions>();
  options->project = &project;
  SourceFiles* files = &options->files;
  AddFiles(command, "--layout", &files->layout, fmt::format("The focal plane: {}", project.layout))
      ->required();
  AddFiles(command, "--targets", &files->targets, "The configuration");
  AddFiles(command, "--state", &files->state, "Where the robots stand");
  AddFiles(command, "--moves", &files->moves, "Measured moves");
  AddFiles(command, "--fiducials", &files->fiducials, "Lights for the camera");
  AddFiles(command, "--disabled", &files->disabled,
           "Robots that stand where they are, with reason, theta_deg, phi_deg where known");
  if (std::string_view(project.name) == "pfs")
    AddFiles(command, "--fibre-map", &files->fibre_map, "Table of cobraId and fiberId");
  if (std::string_view(project.name) == "desi")
    command->add_flag(
        "--from-camera", files->from_camera,
        "Moves begin where the camera saw the fibre (fvc_t, fvc_p), not at the count");
  command
      ->add_option("--gear", files->gears, "Motor turns per axis turn, for both axes or theta phi")
      ->expected(1, 2)
      ->check(NumberBetween(0.001, 1e6));
  command
      ->add_option("--arm-half-width-mm", files->arm_half_width_mm,
                   "Half the width of the phi arms (default: 0.08 of the nearest neighbour)")
      ->check(NumberBetween(0.001, 100));
  command
      ->add_option("--fiducial-radius-mm", files->fiducial_radius_mm,
                   "Fiducials are obstacles of this radius (default: they are none)")
      ->check(NumberBetween(0.001, 100));
  command->add_option("--out", options->out, "Folder to write")->type_name("DIR")->required();
  OnChosen(line, command, options, RunImport);
}

void AddExportOf(const Project& project, CLI::App* parent, CommandLine* line) {
  CLI::App* command = AddCommand(
      parent, project.name,
      fmt::format("A configuration as the pipeline of {} reads it", project.robots).c_str(),
      project.export_example);
  auto options = std::make_shared<ExportOptions>();
  options->project = &project;
  observatory::ExportRequest* request = &options->request;
  command->add_option("--import", request->folder, "Folder of the import")
      ->type_name("DIR")
      ->required();
  AddFile(command, "--targets", &request->targets, "targets.csv (default: the import's)");
  AddFile(command, "--plan", &request->plan, "plan.csv: units are where it ends");
  AddFile(command, "--from", &request->state,
          "state.csv: where the plan begins (default: the import's)");
  AddFile(command, "--fibres", &request->fibres,
          "Measured fibres, as `measurements --out` writes them");
  AddFile(command, "--out", &request->out, "File to write")->required();
  OnChosen(line, command, options, RunExport);
}

}  // namespace

void AddImportCommands(CommandLine* line) {
  CLI::App* in = line->app.add_subcommand("import", "Read the files of another project");
  in->require_subcommand(1);
  CLI::App* out = line->app.add_subcommand("export", "Write a configuration for another project");
  out->require_subcommand(1);
  for (const Project& project : kProjects) {
    AddImportOf(project, in, line);
    AddExportOf(project, out, line);
  }
}

}  // namespace focalfleet::cli
