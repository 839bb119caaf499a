#include <fmt/format.h>

#include <algorithm>

#include "daemon/control/printable.h"
#include "daemon/doctor/judge.h"

namespace focalfleet::doctor {
namespace {

/// Participants that displays and archives may still need.
constexpr std::uint32_t kParticipantsSpare = 10;

/// Source of the ports: DDSI-RTPS 2.2, 9.6.1.1, with its default parameters.
std::uint32_t TakenParticipants(const Facts& facts, const DdsNeeds& needs) {
  std::uint32_t taken = 0;
  for (std::uint32_t index = 0; index < needs.participants; ++index) {
    const std::uint32_t discovery = 7400 + 250 * facts.config->dds.domain + 10 + 2 * index;
    const bool in_use = facts.host.udp_ports.contains(static_cast<std::uint16_t>(discovery)) ||
                        facts.host.udp_ports.contains(static_cast<std::uint16_t>(discovery + 1));
    taken += in_use ? 1 : 0;
  }
  return taken;
}

Check JudgeParticipants(const Facts& facts, const DdsNeeds& needs) {
  const std::uint32_t taken = TakenParticipants(facts, needs);
  const std::string text = fmt::format("{} of {} participants of domain {} are taken on this host",
                                       taken, needs.participants, facts.config->dds.domain);
  const std::string todo =
      "end readers that nobody needs (`ss -ulnp` names them), or raise MaxAutoParticipantIndex";
  if (taken >= needs.participants) return Fail("dds participants", text, todo);
  if (needs.participants - taken < std::min(kParticipantsSpare, needs.participants / 2))
    return Warn("dds participants", text, todo);
  return Ok("dds participants", text);
}

Check JudgeInterface(const Facts& facts, const DdsInterface& wanted, bool multicast) {
  const std::string name = wanted.name.empty() ? wanted.address : wanted.name;
  const auto found =
      std::ranges::find_if(facts.host.interfaces, [&](const NetworkInterface& interface) {
        return wanted.name.empty() ? interface.addresses.contains(wanted.address)
                                   : interface.name == wanted.name;
      });
  if (found == facts.host.interfaces.end())
    return Fail("dds interface", fmt::format("this host has no interface {}", name),
                "ip address lists them; mend NetworkInterface in dds.config");
  if (!found->up)
    return Fail("dds interface", fmt::format("{} is down", found->name),
                fmt::format("ip link set {} up", found->name));
  if (multicast && !found->multicast)
    return Fail("dds interface", fmt::format("{} carries no multicast", found->name),
                fmt::format("ip link set {} multicast on, or multicast=\"false\" and Peers in "
                            "dds.config",
                            found->name));
  return Ok("dds interface", fmt::format("{} is up, {}", found->name,
                                         multicast ? "with multicast" : "multicast is not used"));
}

Check JudgeBuffer(const Facts& facts, const DdsNeeds& needs) {
  const std::uint64_t wanted = needs.buffer_bytes.value_or(0);
  if (!facts.host.receive_buffer_max)
    return Ok("dds buffers", "net.core.rmem_max cannot be read here");
  const std::uint64_t most = *facts.host.receive_buffer_max;
  if (most >= wanted)
    return Ok("dds buffers",
              fmt::format("net.core.rmem_max is {} bytes, {} are asked for", most, wanted));
  return Warn("dds buffers",
              fmt::format("net.core.rmem_max is {} bytes, {} are asked for: what is lost under "
                          "load is sent again",
                          most, wanted),
              fmt::format("sysctl -w net.core.rmem_max={}; for ever in /etc/sysctl.d", wanted));
}

}  // namespace

void JudgeDds(const Facts& facts, Checks* checks) {
  if (!facts.config) return;
  if (!facts.config->dds.enabled && !facts.config->camera.dds) {
    checks->push_back(Ok("dds", "not used: dds.enabled is false"));
    return;
  }
  if (!facts.dds) {
    checks->push_back(Fail("dds", facts.dds.error().text, "mend dds.config"));
    return;
  }
  const Json& status = facts.daemon.status;
  if (status.is_object() && status.contains("dds") && status["dds"].is_object()) {
    const std::string trouble =
        status["dds"].contains("trouble") && status["dds"]["trouble"].is_string()
            ? Printable(status["dds"]["trouble"].get<std::string>())
            : "";
    checks->push_back(trouble.empty()
                          ? Ok("dds", "the daemon takes part")
                          : Fail("dds", trouble, "mend what the dds checks below name"));
  }
  checks->push_back(JudgeParticipants(facts, *facts.dds));
  for (const DdsInterface& interface : facts.dds->interfaces)
    checks->push_back(JudgeInterface(facts, interface, facts.dds->multicast));
  checks->push_back(JudgeBuffer(facts, *facts.dds));
}

}  // namespace focalfleet::doctor
