#include <fmt/format.h>

#include <cstring>

#include "daemon/doctor/judge.h"

namespace focalfleet::doctor {
namespace {

/// Frames that the daemon keeps below a socket (ports/transmit_window.h): a shorter queue of the
/// kernel refuses frames that it counts on.
constexpr std::uint32_t kQueueLeast = 3;

const char* NameOf(ControllerState state) {
  constexpr const char* kNames[] = {"error-active", "error-warning", "error-passive",
                                    "bus-off",      "stopped",       "sleeping"};
  return kNames[static_cast<std::size_t>(state)];
}

std::string LinkSet(const std::string& name, const std::string& settings) {
  return fmt::format("ip link set {0} down; ip link set {0} {1}; ip link set {0} up", name,
                     settings);
}

/// The first fault of the bit timing; empty text: none.
Check JudgeTiming(const std::string& check, const BusInterface& interface,
                  const DaemonConfig::Bus& bus) {
  const CanLink& link = *interface.link;
  const std::string fd = bus.can_fd ? fmt::format(" dbitrate {} fd on", bus.data_bit_rate_bps) : "";
  const std::string mend =
      LinkSet(interface.name, fmt::format("type can bitrate {}{}", bus.bit_rate_bps, fd));
  if (link.kind == "can" && link.bit_rate_bps != bus.bit_rate_bps)
    return Fail(check,
                fmt::format("bit rate {} bit/s, bus.bit_rate_bps is {}", link.bit_rate_bps,
                            bus.bit_rate_bps),
                mend);
  constexpr std::uint32_t kCanFdMtu = 72;  // CANFD_MTU of linux/can.h
  if (bus.can_fd && link.mtu < kCanFdMtu)
    return Fail(
        check, "it carries no CAN FD frames, bus.can_fd asks for them",
        link.kind == "can" ? mend : LinkSet(interface.name, fmt::format("mtu {}", kCanFdMtu)));
  if (bus.can_fd && link.kind == "can" && link.data_bit_rate_bps != bus.data_bit_rate_bps)
    return Fail(check,
                fmt::format("data bit rate {} bit/s, bus.data_bit_rate_bps is {}",
                            link.data_bit_rate_bps, bus.data_bit_rate_bps),
                mend);
  return {};
}

Check JudgeInterface(const Facts& facts, const BusInterface& interface) {
  const std::string check = "interface " + interface.name;
  if (!interface.link)
    return Fail(check, interface.link.error().text,
                "plug in the adapter, load its driver, or mend bus.interfaces");
  const CanLink& link = *interface.link;
  if (Check timing = JudgeTiming(check, interface, facts.config->bus); !timing.text.empty())
    return timing;
  if (!link.up) return Fail(check, "it is down", fmt::format("ip link set {} up", interface.name));
  if (link.state && *link.state > ControllerState::kWarning)
    return Fail(check,
                fmt::format("its controller is {} ({} transmit errors, {} receive errors)",
                            NameOf(*link.state), link.tx_errors, link.rx_errors),
                "look at cable, termination and bit rate of the bus");
  const auto& process = facts.daemon.process;
  const bool daemon_restarts = process && process->may_configure_network.value_or(false);
  if (link.kind == "can" && link.restart_ms == 0 && !daemon_restarts)
    return Warn(check, "nobody restarts it after bus-off: restart-ms is 0",
                LinkSet(interface.name, "type can restart-ms 100"));
  if (link.queue_frames < kQueueLeast)
    return Warn(check,
                fmt::format("its transmit queue holds {} frames, the daemon counts on {}",
                            link.queue_frames, kQueueLeast),
                fmt::format("ip link set {} txqueuelen 10", interface.name));
  if (link.state == ControllerState::kWarning)
    return Warn(check,
                fmt::format("its controller counts many errors ({} transmit, {} receive)",
                            link.tx_errors, link.rx_errors),
                "look at cable, termination and bit rate of the bus");
  return Ok(check, link.kind == "can"
                       ? fmt::format("up, {} bit/s, restart-ms {}, queue {}", link.bit_rate_bps,
                                     link.restart_ms, link.queue_frames)
                       : fmt::format("up ({}), queue {}", link.kind, link.queue_frames));
}

}  // namespace

void JudgeBuses(const Facts& facts, Checks* checks) {
  if (!facts.config) return;
  if (facts.config->bus.port != PortKind::kSocketCan) {
    checks->push_back(Ok(
        "af_can", fmt::format("not needed: bus.port is {}",
                              kPortKindNames[static_cast<std::size_t>(facts.config->bus.port)])));
    return;
  }
  if (facts.host.af_can_error != 0) {
    checks->push_back(Fail(
        "af_can",
        fmt::format("the kernel gives no CAN socket: {}", std::strerror(facts.host.af_can_error)),
        "modprobe can; modprobe can_raw"));
    return;  // without it no interface can be found either
  }
  checks->push_back(Ok("af_can", "the kernel has CAN sockets"));
  for (const BusInterface& interface : facts.interfaces)
    checks->push_back(JudgeInterface(facts, interface));
}

}  // namespace focalfleet::doctor
