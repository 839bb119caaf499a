#include "daemon/process/fleet_setup.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>
#include <utility>

#include "daemon/control/id_ranges.h"
#include "daemon/files/text_file.h"
#include "daemon/ports/simulated_port.h"
#include "daemon/ports/socket_opener.h"
#include "daemon/ports/unix_port.h"
#include "daemon/tables/read_table.h"
#include "fleet/files/fiducials_file.h"
#include "fleet/files/layout_file.h"
#include "fleet/files/obstacles_file.h"

namespace focalfleet {
namespace {

using Ports = std::vector<std::unique_ptr<PollablePort>>;

/// Period, in real time, at which a lost link is tried again.
constexpr DurationNs kRetryPeriod = Milliseconds(200);

Result<Ports> OpenUnix(const DaemonConfig& config, const Layout& layout, const HostClock& clock) {
  Ports ports;
  for (const BusId bus : layout.buses()) {
    const auto path = std::filesystem::path(config.bus.unix_directory) /
                      ("bus" + std::to_string(bus.value) + ".sock");
    FOCALFLEET_TRY_ASSIGN(auto port, UnixPort::Create({.bus = bus,
                                                       .path = path.string(),
                                                       .retry_period = clock.Real(kRetryPeriod),
                                                       .clock = clock}));
    ports.push_back(std::move(port));
  }
  return ports;
}

/// Only a simulated fleet may run faster or slower than real time, on interfaces that carry nothing
/// else.
Status CheckSpeed(const DaemonConfig& config, const HostClock& clock, const SocketCanPort& port) {
  if (clock.speed() == 1 || (port.found() && !port.link().real())) return {};
  return Fail(ErrorCode::kInvalid,
              config.bus.interfaces_at + ": clock.speed must be 1: '" + port.name() +
                  "' is no virtual CAN interface, and real motors do not hurry");
}

Result<Ports> OpenSocketCan(const DaemonConfig& config, const Layout& layout,
                            const HostClock& clock, const InterfaceOpener& open) {
  FOCALFLEET_TRY(CheckInterfaces(config, layout));
  Ports ports;
  bool any = false;
  for (std::size_t b = 0; b < config.bus.interfaces.size(); ++b) {
    auto port = SocketCanPort::Create(
        {.bus = layout.buses()[b],
         .interface = config.bus.interfaces[b],
         .bit_rate_bps = config.bus.bit_rate_bps,
         .data_bit_rate_bps = config.bus.can_fd ? config.bus.data_bit_rate_bps : 0,
         .clock = clock,
         .retry_period = kRetryPeriod,
         .open = open});
    if (!port) return Fail(port.error().code, config.bus.interfaces_at + ": " + port.error().text);
    FOCALFLEET_TRY(CheckSpeed(config, clock, **port));
    any |= (*port)->found();
    ports.push_back(std::move(*port));
  }
  // A single missing interface is an adapter that died. If all are missing, the driver is not
  // loaded, or the file belongs to another machine.
  if (!any && !ports.empty())
    return Fail(ErrorCode::kUnavailable,
                config.bus.interfaces_at +
                    ": none of bus.interfaces is there: " + ports.front()->trouble());
  return ports;
}

Result<Ports> OpenSimulated(const DaemonConfig& config, const Layout& layout,
                            const HostClock& clock) {
  sim::WorldConfig world;
  world.units = DescribeUnits(layout);
  world.seed = config.simulated.seed;
  world.spread = config.simulated.spread == "real" ? sim::Spread::kReal : sim::Spread::kNominal;
  world.bit_rate_bps = config.bus.bit_rate_bps;
  world.start = clock.Now();
  world.joint_sensors = MakeJoints(layout, world.seed, world.spread);
  FOCALFLEET_TRY_ASSIGN(const auto fleet, SimulatedFleet::Create(std::move(world), clock));
  Ports ports;
  for (const BusId bus : layout.buses())
    ports.push_back(std::make_unique<SimulatedPort>(fleet, bus));
  return ports;
}

}  // namespace

Result<Layout> LoadLayout(const DaemonConfig::Fleet& fleet) {
  Layout::Options options{.clearance_mm = fleet.clearance_mm, .obstacles = {}};
  if (!fleet.obstacles.empty()) {
    FOCALFLEET_TRY_ASSIGN(const std::string text, ReadTableAsText(fleet.obstacles, "obstacle_id"));
    FOCALFLEET_TRY_ASSIGN(options.obstacles, ReadObstacles(text, fleet.obstacles));
  }
  FOCALFLEET_TRY_ASSIGN(const std::string text, ReadTableAsText(fleet.units, "unit_id"));
  return ReadLayout(text, fleet.units, std::move(options));
}

Result<Layout> LoadOwnLayout(const DaemonConfig& config) {
  FOCALFLEET_TRY_ASSIGN(Layout whole, LoadLayout(config.fleet));
  if (!config.sector.present()) return whole;
  const auto buses = ParseRanges(config.sector.buses);
  if (!buses) return Fail(ErrorCode::kInvalid, config.sector.buses_at + ": " + buses.error().text);
  std::vector<std::uint8_t> own(whole.size(), 0);
  for (const std::uint32_t bus : *buses) {
    if (!std::ranges::binary_search(whole.buses(), BusId{bus}))
      return Fail(ErrorCode::kInvalid, config.sector.buses_at + ": bus " + std::to_string(bus) +
                                           " is not in " + config.fleet.units);
    for (std::uint32_t n = 0; n < whole.size(); ++n)
      if (whole.units()[n].bus == BusId{bus}) own[n] = 1;
  }
  std::vector<PositionerIndex> chosen;
  for (std::uint32_t n = 0; n < whole.size(); ++n)
    if (own[n] != 0) chosen.push_back({n});
  return whole.Part(chosen);
}

Result<CameraSite> LoadCameraSite(const DaemonConfig::Camera& camera) {
  CameraSite site{.model = camera.model, .sensor = camera.sensor, .fiducials = {}, .options = {}};
  site.options.centroid_sigma_mm = 1e-3 * camera.centroid_sigma_um;
  FOCALFLEET_TRY_ASSIGN(const std::string text, ReadTableAsText(camera.fiducials, "fiducial_id"));
  FOCALFLEET_TRY_ASSIGN(site.fiducials, ReadFiducials(text, camera.fiducials));
  double radius_mm = 0;
  for (const Fiducial& fiducial : site.fiducials)
    radius_mm = std::max(radius_mm, std::hypot(fiducial.at_fp.x_mm, fiducial.at_fp.y_mm));
  site.model.radius_mm = radius_mm;
  return site;
}

Result<std::unique_ptr<FibreCarrierWorker>> OpenFibreCarriers(const DaemonConfig::Hall& hall,
                                                              const Layout& layout) {
  if (hall.model.empty()) return std::unique_ptr<FibreCarrierWorker>();
  FOCALFLEET_TRY_ASSIGN(const std::string text, ReadTextFile(hall.model));
  FOCALFLEET_TRY_ASSIGN(const HallModelFile model, ReadHallModel(text, hall.model));
  return FibreCarrierWorker::Create(
      layout, model, {.noise_T = 1e-3 * hall.noise_mT, .tilt_max_deg = hall.tilt_max_deg});
}

Status CheckInterfaces(const DaemonConfig& config, const Layout& layout) {
  TakeSocketsFrom(config.bus.opener);
  if (config.bus.port != PortKind::kSocketCan) return {};
  const std::size_t interfaces = config.bus.interfaces.size();
  if (interfaces != layout.buses().size())
    return Fail(ErrorCode::kInvalid, config.bus.interfaces_at + ": bus.interfaces names " +
                                         std::to_string(interfaces) + " interfaces, but " +
                                         config.fleet.units + " has " +
                                         std::to_string(layout.buses().size()) + " buses");
  return {};
}

Result<std::unique_ptr<SyncLine>> OpenSync(const DaemonConfig::Sync& sync, GpioKernel& kernel) {
  if (sync.chip.empty()) return std::unique_ptr<SyncLine>();
  auto line = GpioLine::Create(
      {.chip = sync.chip, .line = sync.line, .active_low = sync.active_low}, kernel);
  if (!line) return Fail(line.error().code, sync.chip_at + ": " + line.error().text);
  return line;
}

Result<Ports> OpenPorts(const DaemonConfig& config, const Layout& layout, const HostClock& clock,
                        const InterfaceOpener& open) {
  switch (config.bus.port) {
    case PortKind::kUnix:
      return OpenUnix(config, layout, clock);
    case PortKind::kSocketCan:
      return OpenSocketCan(config, layout, clock, open);
    case PortKind::kSimulated:
      return OpenSimulated(config, layout, clock);
  }
  return Fail(ErrorCode::kInvalid, "no such port");
}

}  // namespace focalfleet
