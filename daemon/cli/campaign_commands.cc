// The commands campaign make and campaign run make moves that are to be measured, for diagnosis.

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>

#include "daemon/campaign/campaign_files.h"
#include "daemon/campaign/campaign_log.h"
#include "daemon/campaign/move_list.h"
#include "daemon/campaign/next_moves_file.h"
#include "daemon/cli/client.h"
#include "daemon/cli/command_line.h"
#include "daemon/cli/configuration_summary.h"
#include "daemon/cli/offline_fleet.h"
#include "daemon/cli/progress_bar.h"
#include "daemon/cli/table_input.h"
#include "daemon/files/text_file.h"
#include "fleet/files/targets_file.h"

namespace focalfleet::cli {
namespace {

// ---- make

struct MakeOptions {
  FleetFiles files;
  std::string kind = kCampaignKindNames[2];
  std::size_t moves = 24;
  std::uint64_t seed = 1;
  std::string out;
};

ExitCode RunMake(const Context& context, const MakeOptions& options) {
  const auto fleet = LoadFleet(context, options.files);
  if (!fleet) return Report(context, fleet.error());
  const auto kind = std::ranges::find(kCampaignKindNames, options.kind);
  const auto moves =
      MakeMoves(fleet->layout, fleet->drives,
                {.kind = static_cast<CampaignKind>(kind - std::begin(kCampaignKindNames)),
                 .moves = options.moves,
                 .seed = options.seed});
  if (!moves) return Report(context, moves.error());
  if (const auto written = WriteFileAtomically(options.out, WriteMoveList(*moves)); !written)
    return Report(context, written.error());
  std::size_t rows = 0;
  for (const ListedMove& move : *moves) rows += move.rows.size();
  if (context.json)
    PrintJson(
        {{"moves", moves->size()}, {"rows", rows}, {"kind", options.kind}, {"out", options.out}});
  Say(context, fmt::format("{}: {} ({}), {}", options.out, Count(moves->size(), "move", "moves"),
                           options.kind, Count(rows, "row", "rows")));
  return ExitCode::kOk;
}

// ---- run

struct RunOptions {
  FleetFiles files;
  std::string list;
  std::string out;
};

/// The position where the daemon believes a unit at rest, and the drive of the unit.
struct Believed {
  AxisAngles angles;
  double v_bus_V = 0;
  double counter1 = 0;
  double repeat = 0;
  std::string mode;
  SerialNumber serial;
};
using BelievedFleet = std::map<std::uint32_t, Believed>;  // by unit id

tl::expected<BelievedFleet, Failure> AskBelieved(const Context& context) {
  const auto state = Ask(context, {.verb = "state"});
  if (!state) return tl::unexpected(state.error());
  BelievedFleet fleet;
  for (const Json& row : ListIn(*state, "rows")) {
    const double theta = NumberIn(row, "theta_low_deg", std::nan(""));
    const double phi = NumberIn(row, "phi_low_deg", std::nan(""));
    if (std::isfinite(theta) && std::isfinite(phi) && theta == NumberIn(row, "theta_high_deg") &&
        phi == NumberIn(row, "phi_high_deg"))
      fleet[static_cast<std::uint32_t>(CountIn(row, "unit_id"))] = {
          // Angles are those that the unit counts: corrections by the camera or a model change from
          // time to time.
          .angles = {theta - NumberIn(row, "theta_offset_deg"),
                     phi - NumberIn(row, "phi_offset_deg")},
          .v_bus_V = NumberIn(row, "v_bus_V", std::nan("")),
          .counter1 = NumberIn(row, "counter1", std::nan("")),
          .repeat = NumberIn(row, "repeat", std::nan("")),
          .mode = TextIn(row, "mode"),
          .serial = {static_cast<std::uint32_t>(CountIn(row, "serial"))}};
  }
  return fleet;
}

bool IsCertainStatus(const std::string& status) {
  for (std::size_t s = 0; s < kMeasurementStatusCount; ++s)
    if (status == Name(static_cast<MeasurementStatus>(s)))
      return IsCertain(static_cast<MeasurementStatus>(s));
  return false;
}

std::vector<LoggedMove> RowsOf(const ListedMove& move, const BelievedFleet& before,
                               const BelievedFleet& after, const Json& measured, double t_s) {
  std::map<std::uint32_t, const Json*> seen;
  for (const Json& row : ListIn(measured, "measurements"))
    seen[static_cast<std::uint32_t>(CountIn(row, "unit_id"))] = &row;
  std::vector<LoggedMove> rows;
  for (const auto& [id, to] : after) {
    const auto from = before.find(id);
    if (from == before.end()) continue;  // its position was not known: no row describes it
    LoggedMove row{.unit = {id},
                   .move = move.id,
                   .from = from->second.angles,
                   .to = to.angles,
                   .x_mm = std::nan(""),
                   .y_mm = std::nan(""),
                   .sigma_um = std::nan(""),
                   .t_s = t_s,
                   .delay_s = std::nan(""),
                   .v_bus_V = to.v_bus_V,
                   .counter1 = to.counter1,
                   .repeat = to.repeat,
                   .mode = to.mode,
                   .serial = to.serial};
    const auto found = seen.find(id);
    if (found != seen.end() && IsCertainStatus(TextIn(*found->second, "status"))) {
      row.x_mm = NumberIn(*found->second, "x_mm");
      row.y_mm = NumberIn(*found->second, "y_mm");
      row.sigma_um = NumberIn(*found->second, "sigma_um");
    }
    if (found != seen.end()) row.delay_s = NumberIn(*found->second, "delay_s", std::nan(""));
    rows.push_back(row);
  }
  return rows;
}

Status WriteFolder(const std::string& folder, const sim::Campaign& campaign) {
  FOCALFLEET_TRY(WriteFileAtomically(folder + "/units.csv", WriteCampaignUnits(campaign)));
  return WriteFileAtomically(folder + "/moves.csv", WriteMoves(campaign));
}

constexpr int kUnmeasuredInARowMax = 3;

/// The result of one move.
struct MadeMove {
  std::optional<Json> measured;  // the daemon's answer to `measurements`; empty: nothing was seen
  std::size_t unserved = 0;      // units that did not make the move, or were not seen
};

/// Makes one move, with its exposure.
/// Errors: as Ask; kBroken: the move was stopped, so no other may follow.
tl::expected<MadeMove, Failure> MakeMove(const Context& context, const ListedMove& move,
                                         const std::string& source, ProgressBar* bar,
                                         const std::string& stage) {
  Question question{.verb = "apply",
                    .args = {{"source", source},
                             {"targets_csv", WriteTargets({.source = source, .rows = move.rows})},
                             {"wait", true},
                             {"corrections", 0},
                             {"observe", true}},
                    .long_lasting = true,
                    .on_progress = [&](const Json& p) {
                      bar->Show(NumberIn(p, "fraction"), stage, DescribeStage(p));
                    }};
  const auto done = Ask(context, question);
  if (!done) return tl::unexpected(done.error());
  if (TextIn(*done, "state") == "stopped")
    return tl::unexpected(
        Failure{ExitCode::kBroken,
                {ErrorCode::kUnavailable, source + ": stopped; no further move is made"}});
  MadeMove made{.measured = {}, .unserved = ListIn(*done, "unserved").size()};
  if (ListIn(*done, "measured").empty()) return made;
  const auto measured = Ask(context, {.verb = "measurements"});
  if (!measured) return tl::unexpected(measured.error());
  made.measured = *measured;
  return made;
}

ExitCode RunCampaign(const Context& context, const RunOptions& options) {
  const auto fleet = LoadFleet(context, options.files);
  if (!fleet) return Report(context, fleet.error());
  const auto text = ReadTable(context, options.list, "unit_id");
  if (!text) return Report(context, text.error());
  const auto list = ReadMoveList(*text, options.list, fleet->layout);
  if (!list) return Report(context, list.error());
  ReportPassedOver(context, options.list, list->ignored_columns);
  const std::vector<ListedMove>& moves = list->moves;
  const auto asked = ConditionsAsked(*text, options.list);
  if (!asked) return Report(context, asked.error());
  for (const std::string& condition : *asked)
    Say(context, options.list + " asks for " + condition + ": not set by this command");
  const std::filesystem::path folder(options.out);
  std::error_code failed;
  if (const auto there = folder / "moves.csv"; std::filesystem::exists(there, failed))
    return Report(context, {ErrorCode::kInvalid, there.string() +
                                                     ": is there already, and what was measured is "
                                                     "not written over; name another folder"});
  CampaignLog log(&fleet->layout);
  ProgressBar bar(context);
  const auto began = std::chrono::steady_clock::now();
  auto before = AskBelieved(context);
  if (!before) return Report(context, before.error());
  std::filesystem::create_directories(folder, failed);
  if (failed)
    return Report(context, {ErrorCode::kUnavailable, options.out + ": " + failed.message()});
  std::size_t unmeasured = 0;
  std::size_t unserved = 0;
  int in_a_row = 0;
  for (std::size_t m = 0; m < moves.size(); ++m) {
    const ListedMove& move = moves[m];
    const std::string source = SourceOf(fmt::format("{} move {}", options.list, move.id));
    const auto made =
        MakeMove(context, move, source, &bar, fmt::format("move {} of {}", m + 1, moves.size()));
    if (!made) return Report(context, made.error());
    in_a_row = made->measured ? 0 : in_a_row + 1;
    unmeasured += made->measured ? 0u : 1u;
    unserved += made->unserved;
    if (in_a_row == kUnmeasuredInARowMax)
      return Report(context,
                    Failure{ExitCode::kBroken,
                            {ErrorCode::kUnavailable,
                             fmt::format("{}: the camera saw nothing, as in the {} moves before "
                                         "(focalfleet history says why)",
                                         source, kUnmeasuredInARowMax - 1)}});
    const double t_s =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
    const auto after = AskBelieved(context);
    if (!after) return Report(context, after.error());
    // A move that was not seen was still made: its rows are there, without positions.
    log.Add(RowsOf(move, *before, *after, made->measured.value_or(Json::object()), t_s));
    before = after;
    // The folder is written after each move, so that measurements are kept whatever happens later.
    const auto written = WriteFolder(options.out, log.Campaign(options.list));
    if (!written) return Report(context, written.error());
  }
  bar.End();
  const sim::Campaign campaign = log.Campaign(options.list);
  if (context.json)
    PrintJson({{"moves", moves.size()},
               {"units", campaign.units.size()},
               {"rows", campaign.rows()},
               {"unmeasured_moves", unmeasured},
               {"unserved_rows", unserved},
               {"out", options.out}});
  if (unmeasured > 0)
    Say(context, fmt::format("{} could not be measured (focalfleet history says why)",
                             Count(unmeasured, "move", "moves")));
  if (unserved > 0)
    Say(context, fmt::format("{} not made or not seen (focalfleet history says why)",
                             Count(unserved, "move of a unit was", "moves of units were")));
  Say(context, fmt::format("{}: {} of {}, {}", options.out, Count(moves.size(), "move", "moves"),
                           Count(campaign.units.size(), "unit", "units"),
                           Count(campaign.rows(), "row", "rows")));
  return unmeasured + unserved == 0 ? ExitCode::kOk : ExitCode::kSomeUnserved;
}

}  // namespace

void AddCampaignCommands(CommandLine* line) {
  CLI::App* campaign =
      AddCommand(&line->app, "campaign", "Moves that are made to be measured",
                 "  focalfleet campaign make --units units.csv --out moves.csv\n"
                 "  focalfleet campaign run moves.csv --units units.csv --out night1");
  campaign->require_subcommand(1);
  CLI::App* make =
      AddCommand(campaign, "make", "Write a list of moves that tell effects apart",
                 "  focalfleet campaign make --kind diagnostic --moves 60 --units units.csv "
                 "--out moves.csv");
  auto make_options = std::make_shared<MakeOptions>();
  AddFleetFiles(make, &make_options->files);
  OneOf(make->add_option("--kind", make_options->kind, "What the moves are good for"),
        {std::begin(kCampaignKindNames), std::end(kCampaignKindNames)})
      ->capture_default_str();
  make->add_option("--moves", make_options->moves, "How many")
      ->check(CLI::Range(std::size_t{1}, std::size_t{10'000}))
      ->capture_default_str();
  make->add_option("--seed", make_options->seed, "Same seed, same moves")->capture_default_str();
  AddFile(make, "--out", &make_options->out, "File to write")->required();
  OnChosen(line, make, make_options, RunMake);

  CLI::App* run =
      AddCommand(campaign, "run", "Make the moves, measure after each, write the folder",
                 "  focalfleet campaign run moves.csv --units units.csv --out night1");
  auto run_options = std::make_shared<RunOptions>();
  AddFleetFiles(run, &run_options->files);
  AddFile(run, "CAMPAIGN.csv", &run_options->list, "move_id, unit_id, theta_deg, phi_deg")
      ->required();
  AddFile(run, "--out", &run_options->out, "Folder to write: moves.csv, units.csv")->required();
  OnChosen(line, run, run_options, RunCampaign);
}

}  // namespace focalfleet::cli
