// The command layout hex makes a focal plane from a count and a pitch alone.

#include <fmt/format.h>

#include "daemon/cli/command_line.h"
#include "daemon/files/text_file.h"
#include "fleet/files/fiducials_file.h"
#include "fleet/files/layout_file.h"
#include "fleet/hex_layout.h"
#include "protocol/base/limits.h"

namespace focalfleet::cli {
namespace {

struct LayoutOptions {
  HexLayoutOptions hex;
  std::vector<double> arms_mm;  // empty, one for both arms, or theta and phi
  std::vector<double> gears;    // empty, one for both axes, or theta and phi
  std::string out;
  std::string fiducials_out;
};

ExitCode RunLayoutHex(const Context& context, const LayoutOptions& options) {
  HexLayoutOptions hex = options.hex;
  if (!options.arms_mm.empty()) {
    hex.theta_arm_mm = options.arms_mm.front();
    hex.phi_arm_mm = options.arms_mm.back();
  }
  HexPlate plate = MakeHexPlate(hex);
  std::vector<Unit>& units = plate.units;
  if (!options.gears.empty()) {
    for (Unit& unit : units) {
      unit.axis[0].gear = options.gears.front();
      unit.axis[1].gear = options.gears.back();
    }
  }
  // The check is the same as at every later reading: a layout that it refuses is not written.
  const auto layout = Layout::Create(units, {});
  if (!layout) return Report(context, layout.error());
  const std::string text = WriteUnits(layout->units());
  if (const auto written = WriteFileAtomically(options.out, text); !written) {
    return Report(context, written.error());
  }
  if (!options.fiducials_out.empty()) {
    const std::string fiducials = WriteFiducials(plate.fiducials);
    if (const auto written = WriteFileAtomically(options.fiducials_out, fiducials); !written) {
      return Report(context, written.error());
    }
  }
  const std::size_t buses = layout->buses().size();
  if (context.json) {
    PrintJson({{"units", layout->size()},
               {"buses", buses},
               {"pitch_mm", layout->pitch_mm()},
               {"clearance_mm", layout->clearance_mm()},
               {"fiducials", plate.fiducials.size()},
               {"out", options.out}});
  }
  Say(context, fmt::format("{}: {} on {}, pitch {:g} mm", options.out,
                           Count(layout->size(), "unit", "units"), Count(buses, "bus", "buses"),
                           layout->pitch_mm()));
  return ExitCode::kOk;
}

}  // namespace

void AddLayoutCommand(CommandLine* line) {
  CLI::App* layout = line->app.add_subcommand("layout", "Make the file of a focal plane");
  layout->require_subcommand(1);
  CLI::App* command =
      AddCommand(layout, "hex", "Units on a hexagonal lattice, nearest the centre first",
                 "  focalfleet layout hex --count 5000 --pitch-mm 25.6 --out units.csv");
  auto options = std::make_shared<LayoutOptions>();
  command->add_option("--count", options->hex.count, "How many units")
      ->required()
      ->check(CLI::Range(1u, limits::kUnits));
  const CLI::Validator length = NumberBetween(0.01, 1000);
  command->add_option("--pitch-mm", options->hex.pitch_mm, "Distance of neighbours")
      ->check(length)
      ->capture_default_str();
  command
      ->add_option("--arm-mm", options->arms_mm,
                   "Length of both arms, or of theta phi (default: by the pitch, 8.25 at 25.6)")
      ->expected(1, 2)
      ->check(length);
  command
      ->add_option("--gear", options->gears,
                   "Motor turns per axis turn, for both axes or theta phi")
      ->expected(1, 2)
      ->check(NumberBetween(0.001, 1e6));
  command->add_option("--units-per-bus", options->hex.units_per_bus, "Units on one CAN bus")
      ->check(CLI::Range(1u, limits::kNodesPerBus))
      ->capture_default_str();
  command->add_option("--units-per-rail", options->hex.units_per_rail, "Units on one supply rail")
      ->check(CLI::Range(1u, limits::kUnits))
      ->capture_default_str();
  command
      ->add_option("--hall-sensors", options->hex.sensors,
                   "Hall sensors at each unit's joint: 6 or 8")
      ->check(CLI::IsMember({6, 8}));
  command
      ->add_option("--spine-mm", options->hex.carrier_mm,
                   "From such a joint to the fibre (default: twice both arms)")
      ->check(length);
  CLI::Option* fiducials = command
                               ->add_option("--fiducials", options->hex.fiducials,
                                            "Lights for the camera, on places that no arm reaches")
                               ->check(CLI::Range(3u, limits::kFiducials));
  fiducials->needs(
      AddFile(command, "--fiducials-out", &options->fiducials_out, "fiducials.csv to write")
          ->needs(fiducials));
  AddFile(command, "--out", &options->out, "units.csv to write")->required();
  OnChosen(line, command, options, RunLayoutHex);
}

}  // namespace focalfleet::cli
