#include "daemon/process/sector_setup.h"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <string>
#include <utility>

#include "daemon/process/dds_setup.h"
#include "fleet/plane/plane_layout.h"

namespace focalfleet {
namespace {

void Scale(double speed, DurationNs* time) {
  time->ns = static_cast<std::int64_t>(static_cast<double>(time->ns) * std::max(1.0, speed));
}

std::string HostName() {
  std::array<char, 256> name{};
  return ::gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "its host";
}

}  // namespace

PlaneTimes PlaneTimesAt(double speed) {
  PlaneTimes times;
  for (DurationNs* time : {&times.listen, &times.takeover, &times.repeat, &times.body_repeat,
                           &times.silence, &times.gather_patience, &times.round_patience,
                           &times.confirm_window, &times.finish_patience, &times.settle_patience,
                           &times.clock_allowance, &times.clock_patience, &times.border_notice})
    Scale(speed, time);
  return times;
}

SectorAgentConfig AgentTimesAt(double speed) {
  SectorAgentConfig agent;
  for (DurationNs* time :
       {&agent.report_period, &agent.news_period, &agent.confirm_period, &agent.confirm_fresh,
        &agent.suspicion, &agent.plane_silence, &agent.hold_limit})
    Scale(speed, time);
  return agent;
}

Result<std::unique_ptr<SectorSeat>> OpenSector(const DaemonConfig& config, const Layout& layout,
                                               DdsTroubles* troubles, const EventSignal* wake) {
  if (!config.sector.present()) return nullptr;
  SectorAgentConfig agent = AgentTimesAt(config.clock.speed);
  agent.sector = config.sector.number;
  agent.layout = DigestOf(layout);
  agent.start_delay = config.timing.start_delay;
  agent.door = HostName() + ":" + std::filesystem::absolute(config.control.socket).string();
  return SectorSeat::Create(
      {.agent = agent,
       .dds = DdsOptionsOf(config.dds),
       .memory = config.store.path + ".sector",
       .tell =
           [troubles](const std::string& trouble) {
             troubles->Report(AlarmName::kDdsMissing, "the plane", trouble);
           },
       .log_error = [](const std::string& text) { spdlog::error("{}", text); }},
      wake);
}

}  // namespace focalfleet
