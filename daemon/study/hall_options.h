// HallSensorOptions and these functions are shared by the hall commands: the sensors, and the files
// that the commands read.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "daemon/cli/command_line.h"
#include "daemon/hall/field_model_file.h"
#include "daemon/hall/hall_tables.h"
#include "sim/hall/diagnosis/parameters.h"

namespace focalfleet::cli {

struct HallSensorOptions {
  std::string sensors;             // file; empty: the eight sensors by angles
  std::vector<double> angles_deg;  // empty: the paper's
};

void AddHallSensorOptions(CLI::App* command, HallSensorOptions* options);

/// The sensors that the options name.
/// Errors: kInvalid, kUnavailable: of the file; kInvalid: both options are given.
Result<std::vector<sim::HallSensor>> SensorsOf(const HallSensorOptions& options);

/// The model in the file at `path`.
/// Errors: as ReadHallModel and ReadTextFile.
Result<HallModelFile> LoadHallModel(const std::string& path);

sim::HallCampaign CampaignOf(PoseTable table);

void AddHallFit(CommandLine* line, CLI::App* hall);
void AddHallOrient(CommandLine* line, CLI::App* hall);
void AddHallCalibrate(CommandLine* line, CLI::App* hall);
void AddHallDiagnose(CommandLine* line, CLI::App* hall);
void AddHallReproduce(CommandLine* line, CLI::App* hall);

}  // namespace focalfleet::cli
