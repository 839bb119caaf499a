#include "daemon/simulator/simulator.h"

#include <sys/epoll.h>
#include <sys/signalfd.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <utility>

#include "daemon/clock/clock.h"
#include "daemon/control/line_server.h"
#include "daemon/control/printable.h"
#include "daemon/files/text_file.h"
#include "daemon/ports/simulated_port.h"
#include "daemon/simulator/camera_door.h"
#include "daemon/simulator/can_doors.h"
#include "daemon/simulator/faults_file.h"
#include "daemon/simulator/memory_file.h"
#include "daemon/simulator/unix_doors.h"
#include "daemon/simulator/verbs.h"
#include "daemon/tables/read_table.h"
#include "fleet/files/layout_file.h"
#include "fleet/files/state_file.h"

namespace focalfleet::simulator {
namespace {

/// Events closer together than this are handled in one turn: 50 saturated buses end a frame every 3
/// us.
constexpr std::int64_t kGrainNs = 100'000;

Status PlaceUnits(const std::string& path, const Layout& layout, sim::WorldConfig* config) {
  if (path.empty()) return {};
  FOCALFLEET_TRY_ASSIGN(const std::string text, ReadTableAsText(path, "unit_id"));
  const std::vector<UnitDrive> drives(layout.size());
  FOCALFLEET_TRY_ASSIGN(const auto poses, ReadState(text, path, layout, drives));
  FOCALFLEET_TRY(RequirePoses(path, layout, poses, WhoseState::kAll));
  for (std::size_t i = 0; i < layout.size(); ++i)
    for (const Axis axis : kAxes)
      config->units[i].axis[Index(axis)].angle_deg =
          AngleDeg((*poses[i])[Index(axis)], layout.units()[i].axis[Index(axis)],
                   drives[i].axis[Index(axis)]);
  return {};
}

Status Remember(const SimulatorOptions& options, sim::WorldConfig* config) {
  if (options.flash_path.empty() || !std::filesystem::exists(options.flash_path)) return {};
  FOCALFLEET_TRY_ASSIGN(const std::string text, ReadTextFile(options.flash_path));
  FOCALFLEET_TRY_ASSIGN(MemoryFile memory, ReadMemory(text, options.flash_path));
  if (memory.seed != options.seed || memory.spread != options.spread)
    return Fail(ErrorCode::kRefused,
                options.flash_path + ": was written with --seed " + std::to_string(memory.seed) +
                    (memory.spread == sim::Spread::kReal ? " --spread real" : " --spread nominal") +
                    "; start with these, or with another FLASH file");
  config->memory = std::move(memory.units);
  return {};
}

Status PlanFaults(const SimulatorOptions& options, sim::WorldConfig* config) {
  if (options.faults_path.empty()) return {};
  FOCALFLEET_TRY_ASSIGN(const std::string text, ReadTableAsText(options.faults_path, "fault"));
  FOCALFLEET_TRY_ASSIGN(config->faults,
                        ReadFaults(text, options.faults_path, {config->units, config->bit_clock}));
  return {};
}

Status SetClocks(const SimulatorOptions& options, sim::WorldConfig* config) {
  for (const SimulatorOptions::ClockError& error : options.clock_errors)
    for (const std::uint32_t number : error.units) {
      const auto unit = std::ranges::find(config->units, UnitId{number}, &sim::UnitDescription::id);
      if (unit == config->units.end())
        return Fail(ErrorCode::kInvalid, "--clock-error: there is no unit " +
                                             std::to_string(number) + " in " + options.units_path);
      unit->clock_error = error.share;
    }
  return {};
}

Result<sim::WorldConfig> Configure(const SimulatorOptions& options, const HostClock& clock) {
  FOCALFLEET_TRY_ASSIGN(const std::string text, ReadTableAsText(options.units_path, "unit_id"));
  FOCALFLEET_TRY_ASSIGN(const Layout layout, ReadLayout(text, options.units_path, {}));
  sim::WorldConfig config;
  config.units = DescribeUnits(layout);
  config.seed = options.seed;
  config.spread = options.spread;
  config.planted = options.planted;
  config.bit_rate_bps = options.bit_rate_bps;
  config.bit_clock = options.interfaces.empty();
  config.joint_sensors = MakeJoints(layout, options.seed, options.spread);
  FOCALFLEET_TRY(SetClocks(options, &config));
  FOCALFLEET_TRY(PlaceUnits(options.state_path, layout, &config));
  FOCALFLEET_TRY(Remember(options, &config));
  FOCALFLEET_TRY(PlanFaults(options, &config));
  if (const auto valid = sim::World::Validate(config); !valid)
    return Fail(valid.error().code, options.units_path + ": " + valid.error().text);
  config.start = clock.Now();
  return config;
}

Result<std::unique_ptr<BusDoors>> OpenDoors(const SimulatorOptions& options,
                                            std::span<const BusId> buses, const HostClock& clock) {
  const std::vector<BusId> all(buses.begin(), buses.end());
  if (options.interfaces.empty()) {
    FOCALFLEET_TRY_ASSIGN(auto doors, UnixDoors::Create({options.unix_directory, all}));
    return doors;
  }
  FOCALFLEET_TRY_ASSIGN(auto doors, CanDoors::Create({options.interfaces, all, clock}));
  return doors;
}

Result<CameraDoor> OpenCamera(const SimulatorOptions& options) {
  sim::CameraTraits traits;
  traits.centroid_sigma_px = 1e-3 * options.camera_noise_um * traits.optics.pixels_per_mm;
  traits.air.sigma_mm = 1e-3 * options.camera_air_um;
  return CameraDoor::Open({.directory = options.camera_directory,
                           .fiducials_path = options.fiducials_path,
                           .seed = options.seed,
                           .traits = traits});
}

/// The descriptors of the loop itself.
class Wakers {
 public:
  static Result<Wakers> Create() {
    Wakers wakers;
    sigset_t ends;
    ::sigemptyset(&ends);
    ::sigaddset(&ends, SIGTERM);
    ::sigaddset(&ends, SIGINT);
    ::sigprocmask(SIG_BLOCK, &ends, nullptr);
    wakers.epoll_ = ::epoll_create1(EPOLL_CLOEXEC);
    wakers.timer_ = ::timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC);
    wakers.signal_ = ::signalfd(-1, &ends, SFD_NONBLOCK | SFD_CLOEXEC);
    if (wakers.epoll_ < 0 || wakers.timer_ < 0 || wakers.signal_ < 0 ||
        !wakers.Watch(wakers.timer_) || !wakers.Watch(wakers.signal_))
      return Fail(ErrorCode::kUnavailable,
                  std::string("cannot set up the event loop: ") + std::strerror(errno));
    return wakers;
  }
  Wakers(Wakers&& other) noexcept
      : epoll_(std::exchange(other.epoll_, -1)),
        timer_(std::exchange(other.timer_, -1)),
        signal_(std::exchange(other.signal_, -1)) {}
  Wakers& operator=(Wakers&&) = delete;
  Wakers(const Wakers&) = delete;
  Wakers& operator=(const Wakers&) = delete;
  ~Wakers() {
    for (const int fd : {epoll_, timer_, signal_})
      if (fd >= 0) ::close(fd);
  }

  [[nodiscard]] bool Watch(int fd) const {
    epoll_event event{};
    event.events = EPOLLIN;
    event.data.fd = fd;
    return ::epoll_ctl(epoll_, EPOLL_CTL_ADD, fd, &event) == 0;
  }

  /// Sleeps until a descriptor is readable or CLOCK_MONOTONIC shows `at_ns`. True: the process must
  /// end.
  [[nodiscard]] bool Sleep(std::int64_t at_ns) const {
    itimerspec when{};
    if (at_ns != INT64_MAX) {
      const std::int64_t ns = std::max<std::int64_t>(at_ns, 1);
      when.it_value = {ns / 1'000'000'000, ns % 1'000'000'000};
    }
    ::timerfd_settime(timer_, TFD_TIMER_ABSTIME, &when, nullptr);
    std::array<epoll_event, 8> events{};
    const int count = ::epoll_wait(epoll_, events.data(), static_cast<int>(events.size()), -1);
    bool end = false;
    for (int i = 0; i < count; ++i) {
      const int fd = events[static_cast<std::size_t>(i)].data.fd;
      std::uint64_t expirations = 0;
      if (fd == timer_ && ::read(timer_, &expirations, sizeof expirations) < 0) continue;
      if (fd == signal_) end = true;
    }
    return end;
  }

 private:
  Wakers() = default;
  int epoll_ = -1;
  int timer_ = -1;
  int signal_ = -1;
};

class Loop {
 public:
  struct Parts {
    const HostClock* clock;
    sim::World* world;
    BusDoors* doors;
    LineServer* control;  // none: null
    CameraDoor* camera;   // none: null
    const Wakers* wakers;
  };
  explicit Loop(const Parts& parts) : parts_(parts), verbs_(parts.world, parts.camera) {}

  void Run() {
    for (;;) {
      Turn();
      if (verbs_.quit()) return;
      const HostInstant now = parts_.clock->Now();
      HostInstant due =
          std::min({parts_.world->NextEvent(), parts_.doors->wake_at(), verbs_.wake_at()});
      if (parts_.camera != nullptr) due = std::min(due, parts_.camera->wake_at());
      std::int64_t at_ns = parts_.clock->ToMonotonic(due);
      if (due != kNever) at_ns = std::max(at_ns, parts_.clock->ToMonotonic(now) + kGrainNs);
      if (parts_.wakers->Sleep(at_ns)) return;
    }
  }

 private:
  void Turn() {
    const HostInstant now = parts_.clock->Now();
    Advance(now);
    verbs_.Tick(now);
    parts_.doors->Exchange(*parts_.clock, parts_.world);
    // Received frames may end at once (a real bus has taken its time already).
    Advance(parts_.clock->Now());
    if (parts_.camera != nullptr) LetLook(now);
    if (parts_.control != nullptr) Answer();
  }

  void Advance(HostInstant now) {
    delivered_.clear();
    carried_.clear();
    parts_.world->AdvanceTo(now, &delivered_, &carried_);
    if (!carried_.empty()) parts_.doors->Carry(carried_);
  }

  void LetLook(HostInstant now) {
    if (const Status looked = parts_.camera->Serve(now, *parts_.world); !looked)
      std::fprintf(stderr, "focalfleet-sim: %s\n", PrintableLines(looked.error().text).c_str());
  }

  void Answer() {
    parts_.control->Service(&urgent_);
    std::size_t left = parts_.control->clients();  // lines of one turn
    for (; left > 0; --left) {
      const auto line = parts_.control->Next();
      if (!line) return;
      Answer(*line);
    }
  }

  void Answer(const IncomingLine& line) {
    const auto request = DecodeRequest(line.text);
    if (!request) {
      parts_.control->Answer(line.client, EncodeError(0, request.error()));
      return;
    }
    const auto result = verbs_.Do(*request);
    parts_.control->Answer(line.client, result ? EncodeResult(request->id, *result)
                                               : EncodeError(request->id, result.error()));
  }

  Parts parts_;
  Verbs verbs_;
  std::vector<ReceivedFrame> delivered_;
  std::vector<sim::WireFrame> carried_;
  std::vector<IncomingLine> urgent_;  // empty: no line is urgent
};

}  // namespace

Status RunSimulator(const SimulatorOptions& options) {
  const HostClock clock(options.speed);
  FOCALFLEET_TRY_ASSIGN(sim::WorldConfig config, Configure(options, clock));
  FOCALFLEET_TRY_ASSIGN(const Wakers wakers, Wakers::Create());
  sim::World world(std::move(config));
  FOCALFLEET_TRY_ASSIGN(const auto doors, OpenDoors(options, world.buses(), clock));
  std::optional<LineServer> control;
  if (!options.control_path.empty()) {
    FOCALFLEET_TRY_ASSIGN(control, LineServer::Create(options.control_path));
  }
  if (!wakers.Watch(doors->fd()) || (control && !wakers.Watch(control->fd())))
    return Fail(ErrorCode::kUnavailable, std::string("cannot watch: ") + std::strerror(errno));
  std::optional<CameraDoor> camera;
  if (!options.camera_directory.empty()) {
    FOCALFLEET_TRY_ASSIGN(camera, OpenCamera(options));
  }
  std::puts("ready");
  std::fflush(stdout);
  Loop({&clock, &world, doors.get(), control ? &*control : nullptr, camera ? &*camera : nullptr,
        &wakers})
      .Run();
  if (options.flash_path.empty()) return {};
  return WriteFileAtomically(options.flash_path,
                             WriteMemory({options.seed, options.spread, world.Memory()}));
}

}  // namespace focalfleet::simulator
