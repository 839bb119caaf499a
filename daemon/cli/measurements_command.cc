// The command measurements shows what the camera found in one exposure, as a table. The
// spectrograph's pipeline reads it as FITS.

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "daemon/cli/client.h"
#include "daemon/cli/command_line.h"
#include "daemon/cli/table.h"
#include "daemon/files/fits_table.h"
#include "daemon/files/text_file.h"
#include "fleet/files/csv.h"
#include "fleet/measurement.h"

namespace focalfleet::cli {
namespace {

struct MeasurementsOptions {
  std::uint64_t exposure = 0;  // 0: the newest of the last configuration
  std::string out = "-";
  std::uint64_t worst = 0;  // 0: all, as a table for files
};

double NumberOrNan(const Json& row, const char* key) {
  const auto found = row.find(key);
  return found != row.end() && found->is_number() ? found->get<double>() : std::nan("");
}

/// Status of a unit that was moved again after the exposure and not seen since: its position is not
/// known.
constexpr const char* kMovedSince = "moved_since";

/// A bit for each status, in the order of MeasurementStatus, then kMovedSince; docs/files.md.
std::int64_t StatusBits(const std::string& status) {
  if (status == kMovedSince) return std::int64_t{1} << kMeasurementStatusCount;
  for (std::size_t bit = 0; bit < kMeasurementStatusCount; ++bit)
    if (status == Name(static_cast<MeasurementStatus>(bit))) return std::int64_t{1} << bit;
  return 0;
}

FitsTable TableOf(const Json& answer) {
  std::vector<std::int64_t> units, bits;
  std::vector<double> target_x, target_y, x, y, sigma, var_x, cov_xy, var_y, error;
  std::vector<std::string> target, status, source, at;
  std::vector<std::string> sensors;
  std::vector<double> alpha, beta, gamma;
  std::int64_t configuration = 0;
  for (const Json& row : ListIn(answer, "measurements")) {
    units.push_back(static_cast<std::int64_t>(CountIn(row, "unit_id")));
    configuration = static_cast<std::int64_t>(CountIn(row, "configuration"));
    const bool moved_since = row.value("moved_since", false);
    status.push_back(moved_since ? kMovedSince : TextIn(row, "status"));
    source.push_back(TextIn(row, "source"));
    const Json& orientation = ObjectIn(row, "orientation");
    sensors.push_back(TextIn(orientation, "verdict"));
    alpha.push_back(NumberOrNan(orientation, "alpha_deg"));
    beta.push_back(NumberOrNan(orientation, "beta_deg"));
    gamma.push_back(NumberOrNan(orientation, "gamma_deg"));
    bits.push_back(StatusBits(status.back()));
    // Without a spot the row has no position; 0, 0 would look like one. The position before a later
    // move is not valid either (--json has it).
    const bool seen = NumberIn(row, "sigma_um") > 0 && !moved_since;
    x.push_back(seen ? NumberIn(row, "x_mm") : std::nan(""));
    y.push_back(seen ? NumberIn(row, "y_mm") : std::nan(""));
    sigma.push_back(seen ? NumberIn(row, "sigma_um") : std::nan(""));
    var_x.push_back(seen ? NumberIn(row, "var_x_mm2") : std::nan(""));
    cov_xy.push_back(seen ? NumberIn(row, "cov_xy_mm2") : std::nan(""));
    var_y.push_back(seen ? NumberIn(row, "var_y_mm2") : std::nan(""));
    target.push_back(TextIn(row, "target_id"));
    target_x.push_back(NumberOrNan(row, "target_x_mm"));
    target_y.push_back(NumberOrNan(row, "target_y_mm"));
    error.push_back(moved_since ? std::nan("") : NumberOrNan(row, "error_um"));
    at.push_back(TextIn(row, "at"));
  }
  return {.name = "FIBRES",
          .keys = {{"EXPOSURE", static_cast<std::int64_t>(CountIn(answer, "exposure")), ""},
                   {"CONFIG", configuration, "number of the configuration"},
                   {"ORIGIN", std::string("focalfleet"), ""}},
          .columns = {{"UNIT_ID", "", std::move(units)},
                      {"TARGET_ID", "", std::move(target)},
                      {"TARGET_X_MM", "mm", std::move(target_x)},
                      {"TARGET_Y_MM", "mm", std::move(target_y)},
                      {"X_MM", "mm", std::move(x)},
                      {"Y_MM", "mm", std::move(y)},
                      {"SIGMA_UM", "um", std::move(sigma)},
                      {"VAR_X_MM2", "mm2", std::move(var_x)},
                      {"COV_XY_MM2", "mm2", std::move(cov_xy)},
                      {"VAR_Y_MM2", "mm2", std::move(var_y)},
                      {"ERROR_UM", "um", std::move(error)},
                      {"STATUS_BITS", "", std::move(bits)},
                      {"STATUS", "", std::move(status)},
                      {"SOURCE", "", std::move(source)},
                      {"SENSORS", "", std::move(sensors)},
                      {"ALPHA_DEG", "deg", std::move(alpha)},
                      {"BETA_DEG", "deg", std::move(beta)},
                      {"GAMMA_DEG", "deg", std::move(gamma)},
                      {"MEASURED_UTC", "", std::move(at)}}};
}

std::string CsvOf(const FitsTable& table) {
  std::vector<std::string> names;
  for (const FitsColumn& column : table.columns) {
    names.push_back(column.name);
    for (char& letter : names.back())
      if (letter >= 'A' && letter <= 'Z') letter = static_cast<char>(letter - 'A' + 'a');
  }
  const std::vector<std::string_view> views(names.begin(), names.end());
  CsvWriter csv(views);
  for (std::size_t row = 0; row < table.rows(); ++row) {
    for (const FitsColumn& column : table.columns) {
      if (const auto* numbers = std::get_if<std::vector<double>>(&column.values))
        csv.Number((*numbers)[row]);
      else if (const auto* whole = std::get_if<std::vector<std::int64_t>>(&column.values))
        csv.Integer((*whole)[row]);
      else
        csv.Text(std::get<std::vector<std::string>>(column.values)[row]);
    }
    csv.EndRow();
  }
  return csv.Take();
}

/// Keeps rows of units with a target: those whose error is not known, then the farthest from it.
void KeepWorst(std::size_t count, Json* rows) {
  Json::array_t kept;
  for (Json& row : *rows)
    if (std::isfinite(NumberOrNan(row, "target_x_mm"))) kept.push_back(std::move(row));
  const auto error_um = [](const Json& row) {
    const double error = NumberOrNan(row, "error_um");
    return row.value("moved_since", false) || std::isnan(error) ? HUGE_VAL : error;
  };
  std::ranges::stable_sort(kept,
                           [&](const Json& a, const Json& b) { return error_um(a) > error_um(b); });
  if (kept.size() > count) kept.resize(count);
  *rows = std::move(kept);
}

std::string WorstAsText(const Json& answer) {
  std::vector<std::vector<std::string>> rows = {{"unit", "error", "from target", "status"}};
  for (const Json& row : ListIn(answer, "measurements")) {
    const double error_um = NumberOrNan(row, "error_um");
    const bool moved_since = row.value("moved_since", false);
    const bool known = std::isfinite(error_um) && !moved_since;
    const auto off_um = [&](const char* at, const char* target) {
      return 1000 * (NumberIn(row, at) - NumberIn(row, target));
    };
    rows.push_back({std::to_string(CountIn(row, "unit_id")),
                    known ? fmt::format("{:.1f} um", error_um) : "unknown",
                    known ? fmt::format("{:+.1f}, {:+.1f} um", off_um("x_mm", "target_x_mm"),
                                        off_um("y_mm", "target_y_mm"))
                          : "",
                    moved_since ? kMovedSince : TextIn(row, "status")});
  }
  if (rows.size() == 1) return "no unit has a target";
  return AlignColumns(std::move(rows));
}

ExitCode RunMeasurements(const Context& context, const MeasurementsOptions& options) {
  Json args = Json::object();
  if (options.exposure != 0) args["exposure"] = options.exposure;
  auto answer = Ask(context, {.verb = "measurements", .args = args});
  if (!answer) return Report(context, answer.error());
  if (options.worst > 0 && answer->contains("measurements"))
    KeepWorst(options.worst, &(*answer)["measurements"]);
  if (context.json) {
    PrintJson(*answer);
    if (options.out == "-") return ExitCode::kOk;
  }
  if (options.worst > 0 && options.out == "-") {
    std::puts(WorstAsText(*answer).c_str());
    return ExitCode::kOk;
  }
  const FitsTable table = TableOf(*answer);
  const Status written = options.out.ends_with(".fits")
                             ? WriteFitsTable(options.out, table)
                             : WriteFileAtomically(options.out, CsvOf(table));
  if (!written) return Report(context, written.error());
  if (options.out != "-")
    Say(context, fmt::format("{}: {} of exposure {}", options.out,
                             Count(table.rows(), "unit", "units"), CountIn(*answer, "exposure")));
  return ExitCode::kOk;
}

}  // namespace

void AddMeasurementsCommand(CommandLine* line) {
  CLI::App* command =
      AddCommand(&line->app, "measurements", "What was found of each unit in one exposure",
                 "  focalfleet measurements --worst 10\n"
                 "  focalfleet measurements --out fibres.fits\n"
                 "  focalfleet measurements --exposure 12 --json");
  auto options = std::make_shared<MeasurementsOptions>();
  command
      ->add_option("--exposure", options->exposure,
                   "Its number; without it the newest of the last configuration")
      ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{INT64_MAX}));
  AddFile(command, "--out", &options->out, "File to write: .fits, or else CSV; - is stdout")
      ->capture_default_str();
  command
      ->add_option(
          "--worst", options->worst,
          "Only the N units farthest from their targets, those with an unknown error first")
      ->option_text("N")
      ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{1'000'000}));
  OnChosen(line, command, options, RunMeasurements);
}

}  // namespace focalfleet::cli
