#include "daemon/cli/direct_stop.h"

#include <fmt/format.h>
#include <poll.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <filesystem>
#include <memory>
#include <set>

#define TOML_EXCEPTIONS 0
#include <toml++/toml.h>

#include "daemon/files/text_file.h"
#include "daemon/ports/socketcan_port.h"
#include "daemon/ports/unix_port.h"
#include "daemon/tables/read_table.h"
#include "fleet/files/layout_file.h"
#include "protocol/wire/codec.h"

namespace focalfleet::cli {
namespace {

constexpr int kTimesSent = 3;
constexpr DurationNs kBetween = Milliseconds(50);
constexpr DurationNs kListen = Milliseconds(1000);
constexpr std::uint8_t kSequence = 255;

HostInstant Now() {
  const auto since = std::chrono::steady_clock::now().time_since_epoch();
  return {std::chrono::duration_cast<std::chrono::nanoseconds>(since).count()};
}

// ---- The configuration

struct BusPlace {
  BusId bus;
  std::string place;  // interface or path
  bool unix_socket = false;
};

std::optional<std::uint32_t> NumberOf(std::string_view name, std::string_view before,
                                      std::string_view after) {
  if (name.size() <= before.size() + after.size() || !name.starts_with(before) ||
      !name.ends_with(after)) {
    return std::nullopt;
  }
  name.remove_prefix(before.size());
  name.remove_suffix(after.size());
  std::uint32_t number = 0;
  const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), number);
  if (error != std::errc() || end != name.data() + name.size()) return std::nullopt;
  return number;
}

Result<std::vector<BusPlace>> UnixBuses(const std::string& directory, const std::string& config) {
  std::error_code error;
  std::vector<BusPlace> buses;
  for (std::filesystem::directory_iterator entry(directory, error), end; !error && entry != end;
       entry.increment(error)) {
    const auto number = NumberOf(entry->path().filename().string(), "bus", ".sock");
    if (number) buses.push_back({BusId{*number}, entry->path().string(), true});
  }
  if (error) {
    return Fail(ErrorCode::kUnavailable,
                fmt::format("{}: [bus] unix_directory {}: {}", config, directory, error.message()));
  }
  std::sort(buses.begin(), buses.end(),
            [](const BusPlace& a, const BusPlace& b) { return a.bus < b.bus; });
  if (buses.empty()) {
    return Fail(
        ErrorCode::kUnavailable,
        fmt::format("{}: [bus] unix_directory {}: no bus<ID>.sock there", config, directory));
  }
  return buses;
}

Result<std::vector<BusPlace>> CanBuses(const toml::table& table, const std::string& config) {
  std::vector<BusPlace> buses;
  if (const toml::array* interfaces = table["bus"]["interfaces"].as_array()) {
    for (const toml::node& node : *interfaces) {
      if (const auto name = node.value<std::string>()) {
        buses.push_back({BusId{static_cast<std::uint32_t>(buses.size())}, *name, false});
      }
    }
  }
  if (buses.empty()) {
    return Fail(ErrorCode::kInvalid, fmt::format("{}: [bus] interfaces: none named", config));
  }
  return buses;
}

std::string BesideConfig(const std::string& config, const std::string& path) {
  return (std::filesystem::path(config).parent_path() / path).string();
}

Result<std::vector<BusPlace>> BusesOf(const toml::table& table, const std::string& config) {
  const auto port = table["bus"]["port"].value_or(std::string("unix"));
  if (port == "unix") {
    const auto directory = table["bus"]["unix_directory"].value<std::string>();
    if (!directory || directory->empty()) {
      return Fail(ErrorCode::kInvalid, fmt::format("{}: [bus] unix_directory: not given", config));
    }
    return UnixBuses(BesideConfig(config, *directory), config);
  }
  if (port == "socketcan") return CanBuses(table, config);
  return Fail(
      ErrorCode::kInvalid,
      fmt::format("{}: [bus] port: \"{}\"; only the buses of \"unix\" and \"socketcan\" can be "
                  "reached without the daemon",
                  config, port));
}

Result<toml::table> ReadConfig(const std::string& config) {
  FOCALFLEET_TRY_ASSIGN(const std::string text, ReadTextFile(config));
  toml::parse_result parsed = toml::parse(text, config);
  if (!parsed) {
    return Fail(ErrorCode::kInvalid,
                fmt::format("{}:{}: {}", config, parsed.error().source().begin.line,
                            std::string(parsed.error().description())));
  }
  return std::move(parsed).table();
}

struct Aim {
  std::vector<BusPlace> places;
  NodeId node = kBroadcastNode;
};

// Selects the bus of one unit. Interfaces stand in the order of ascending bus ids; a socket's name
// gives its bus.
Result<Aim> AimAtUnit(const toml::table& table, UnitId id, const std::string& config, Aim all) {
  const std::string path =
      BesideConfig(config, table["fleet"]["units"].value_or(std::string("units.csv")));
  FOCALFLEET_TRY_ASSIGN(const std::string text, ReadTableAsText(path, "unit_id"));
  FOCALFLEET_TRY_ASSIGN(const Layout layout, ReadLayout(text, path, {}));
  const auto i = layout.Find(id);
  if (!i) return Fail(ErrorCode::kInvalid, fmt::format("{}: there is no unit {}", path, id.value));
  const Unit& unit = layout.unit(*i);
  for (BusPlace& place : all.places) {
    const bool ranked = !place.unix_socket && place.bus.value < layout.buses().size();
    if (ranked) place.bus = layout.buses()[place.bus.value];
    if (place.bus == unit.bus) return Aim{{std::move(place)}, unit.node};
  }
  return Fail(ErrorCode::kUnavailable,
              fmt::format("{}: bus {} of unit {} is not there", config, unit.bus.value, id.value));
}

Result<Aim> AimAt(const toml::table& table, const DirectStopRequest& request) {
  Aim all;
  FOCALFLEET_TRY_ASSIGN(all.places, BusesOf(table, request.config));
  if (!request.unit) return all;
  return AimAtUnit(table, *request.unit, request.config, std::move(all));
}

// ---- The buses

struct OpenBus {
  std::unique_ptr<PollablePort> port;  // null: it could not be opened
  std::set<NodeId> answered;
  bool sent = false;
};

template <class Port>
Result<std::unique_ptr<PollablePort>> Widened(Result<std::unique_ptr<Port>> port) {
  if (!port) return tl::unexpected<Error>(std::move(port).error());
  return std::unique_ptr<PollablePort>(std::move(*port));
}

Result<std::unique_ptr<PollablePort>> OpenPort(const BusPlace& place) {
  if (place.unix_socket) {
    return Widened(UnixPort::Create({.bus = place.bus, .path = place.place}));
  }
  return Widened(SocketCanPort::Create({.bus = place.bus, .interface = place.place}));
}

void Listen(std::vector<OpenBus>* buses, HostInstant until) {
  std::vector<ReceivedFrame> frames;
  while (Now() < until) {
    std::vector<pollfd> polls;
    for (const OpenBus& bus : *buses) {
      if (bus.port != nullptr) polls.push_back({bus.port->fd(), POLLIN, 0});
    }
    const auto left_ms = static_cast<int>((until - Now()).ns / 1'000'000) + 1;
    if (poll(polls.data(), polls.size(), left_ms) <= 0) return;
    for (OpenBus& bus : *buses) {
      if (bus.port == nullptr) continue;
      frames.clear();
      bus.port->Receive(Now(), &frames);
      for (const ReceivedFrame& received : frames) {
        const auto message = DecodeUnit(received.frame);
        if (message && std::holds_alternative<Done>(message->message)) {
          bus.answered.insert(message->address.node);
        }
      }
    }
  }
}

void SendStop(std::vector<OpenBus>* buses, const CanFrame& frame) {
  for (OpenBus& bus : *buses) {
    if (bus.port != nullptr && bus.port->Send({&frame, 1}) == 1) bus.sent = true;
  }
}

}  // namespace

Result<std::vector<DirectStopBus>> DirectStop(const DirectStopRequest& request) {
  FOCALFLEET_TRY_ASSIGN(const toml::table table, ReadConfig(request.config));
  FOCALFLEET_TRY_ASSIGN(const Aim aim, AimAt(table, request));

  std::vector<DirectStopBus> report;
  std::vector<OpenBus> buses;
  for (const BusPlace& place : aim.places) {
    auto port = OpenPort(place);
    report.push_back({.name = place.place, .trouble = port ? "" : port.error().text});
    buses.push_back({.port = port ? std::move(*port) : nullptr});
  }
  const CanFrame frame = Encode(HostMessage(Stop{}), {aim.node, kSequence});
  const HostInstant end = Now() + kListen;
  for (int i = 0; i < kTimesSent; ++i) {
    SendStop(&buses, frame);
    Listen(&buses, Now() + kBetween);
  }
  Listen(&buses, end);
  for (std::size_t i = 0; i < buses.size(); ++i) {
    report[i].sent = buses[i].sent;
    report[i].units_answered = static_cast<std::uint32_t>(buses[i].answered.size());
    if (!buses[i].sent && buses[i].port != nullptr) report[i].trouble = buses[i].port->trouble();
  }
  return report;
}

}  // namespace focalfleet::cli
