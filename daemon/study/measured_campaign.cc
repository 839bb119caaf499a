#include "daemon/study/measured_campaign.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <thread>
#include <vector>

#include "daemon/access/sha256.h"
#include "daemon/campaign/campaign_files.h"
#include "daemon/files/text_file.h"

namespace focalfleet::cli {

Result<MeasuredCampaign> ReadMeasuredCampaign(const Context& context, const std::string& folder) {
  const std::filesystem::path path(folder);
  const std::string moves_file = path / "moves.csv", units_file = path / "units.csv";
  FOCALFLEET_TRY_ASSIGN(const std::string moves, ReadTextFile(moves_file));
  FOCALFLEET_TRY_ASSIGN(const std::string units, ReadTextFile(units_file));
  MeasuredCampaign in;
  in.names.campaign = path.filename().empty() ? path.parent_path().filename() : path.filename();
  TableNotes notes;
  FOCALFLEET_TRY_ASSIGN(in.campaign, ReadCampaign({.moves = moves,
                                                   .units = units,
                                                   .moves_file = moves_file,
                                                   .units_file = units_file,
                                                   .name = in.names.campaign},
                                                  &notes));
  ReportPassedOver(context, units_file, notes.ignored_of_units);
  ReportPassedOver(context, moves_file, notes.ignored_of_moves);
  if (notes.rows_out_of_order > 0)
    Say(context, fmt::format("note: {} of {} rows stand behind a later move of their unit: rows "
                             "were sorted",
                             notes.rows_out_of_order, in.campaign.rows()));
  in.names.sha256 = Sha256Hex(moves + units);
  in.names.model_after = in.names.campaign + "-extended";
  return in;
}

Result<ModelFile> ReadModelFor(const sim::Campaign& campaign, const std::string& file) {
  FOCALFLEET_TRY_ASSIGN(const std::string text, ReadTextFile(file));
  return ReadModelFile(text, file, campaign.units);
}

sim::ParallelFor OnThreads(int threads) {
  const unsigned count = threads > 0 ? static_cast<unsigned>(threads)
                                     : std::max(1u, std::thread::hardware_concurrency());
  if (count == 1) return sim::OneAfterTheOther();
  return [count](std::size_t chunks, const std::function<void(std::size_t)>& work) {
    std::atomic<std::size_t> next{0};
    const auto take = [&] {
      for (std::size_t chunk = 0; (chunk = next++) < chunks;) work(chunk);
    };
    std::vector<std::thread> others;
    for (unsigned k = 1; k < count; ++k) others.emplace_back(take);
    take();
    for (std::thread& other : others) other.join();
  };
}

}  // namespace focalfleet::cli
