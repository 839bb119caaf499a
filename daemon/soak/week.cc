#include "daemon/soak/week.h"

#include <fmt/format.h>
#include <malloc.h>

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <utility>

#include "daemon/soak/night.h"
#include "daemon/soak/virtual_time.h"

namespace focalfleet::soak {

std::string WeekColumns() {
  return "configuration,night,virtual_h,memory_bytes,store_bytes,store_log_bytes,batches,"
         "descriptors,arrived";
}

std::string WeekLine(const WeekSizes& sizes) {
  return fmt::format("{},{},{:.4f},{},{},{},{},{},{}", sizes.configuration, sizes.night,
                     sizes.virtual_h, sizes.memory, sizes.store, sizes.store_log, sizes.batches,
                     sizes.descriptors, sizes.arrived);
}

std::size_t MemoryInUse() {
  const struct mallinfo2 info = ::mallinfo2();
  return info.uordblks + info.hblkhd;
}

std::size_t DescriptorsOpen() {
  return static_cast<std::size_t>(
      std::distance(std::filesystem::directory_iterator("/proc/self/fd"), {}));
}

WeekSizes Night::SizesAfter(std::uint32_t configuration, std::uint32_t night) const {
  const std::size_t memory = MemoryInUse();
  return {.configuration = configuration,
          .night = night,
          .virtual_h = static_cast<double>(now_.ns) / 3.6e12,
          .memory = memory - std::min(memory, disk_->memory()),
          .store = disk_->size("store.sqlite"),
          .store_log = disk_->size("store.sqlite-wal"),
          .batches = life_->writer().waiting(),
          .descriptors = DescriptorsOpen(),
          .arrived = 0};
}

/// The daemon is ended in the morning, and the next evening it starts.
void Night::PassDay() {
  constexpr std::int64_t kDayNs = 86'400'000'000'000;
  OfHost(FaultSite::kHostEnds);
  t_virtual_time.wall_less_host_ns += kDayNs;
}

NightResult Night::RunWeek(const Week& week, const std::function<void(const WeekSizes&)>& take) {
  constexpr double kSettleS = 300, kConfigurationS = 600;
  Liveness people = SecondPhase();
  std::uint32_t night = 0;
  for (std::uint32_t n = 0; n < week.configurations && judge_->broken().empty(); ++n) {
    if (std::exchange(night, week.NightOf(n)) != week.NightOf(n)) PassDay();
    RunUntil(now_ + Seconds(kSettleS), [this] { return life_ != nullptr; });
    if (!people.Settle(kSettleS)) judge_->Broken("liveness", "units are not ready in the evening");
    const std::uint64_t request =
        operators_->Ask("apply", {{"targets_csv", operators_->DrawTargets(1)}, {"wait", true}});
    people.WaitFor(request, kConfigurationS);
    const ControlAnswer* answer = operators_->Answer(request);
    std::size_t arrived = 0;
    if (answer == nullptr)
      judge_->Broken("liveness", "no answer to apply");
    else if (answer->kind == ControlAnswer::Kind::kError)
      judge_->Broken("liveness", answer->error.text);
    else
      arrived = answer->body.value("arrived", std::size_t{0});
    if (arrived != plant_->layout().size())
      judge_->Broken("liveness",
                     fmt::format("{} units of {} arrived", arrived, plant_->layout().size()));
    people.Pause();
    WeekSizes sizes = SizesAfter(n + 1, night + 1);
    sizes.arrived = arrived;
    take(sizes);
  }
  return Finish();
}

}  // namespace focalfleet::soak
