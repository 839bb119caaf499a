#include <fmt/format.h>

#include <cerrno>
#include <cstring>

#include "daemon/control/printable.h"
#include "daemon/doctor/judge.h"

namespace focalfleet::doctor {
namespace {

std::uint64_t CountIn(const Json& object, const char* key) {
  const auto found = object.is_object() ? object.find(key) : object.end();
  return found != object.end() && found->is_number_unsigned() ? found->get<std::uint64_t>() : 0;
}
std::string TextIn(const Json& object, const char* key) {
  const auto found = object.is_object() ? object.find(key) : object.end();
  return found != object.end() && found->is_string() ? Printable(found->get<std::string>()) : "";
}
Json MemberOf(const Json& object, const char* key) {
  const auto found = object.is_object() ? object.find(key) : object.end();
  return found != object.end() ? *found : Json();
}

Check JudgeAnswer(const Facts& facts) {
  const DaemonFacts& daemon = facts.daemon;
  if (daemon.silence.empty())
    return Ok("daemon", fmt::format("it answers at {} as user {}", daemon.socket,
                                    daemon.process ? daemon.process->user.name : "unknown"));
  if (daemon.connect_error == EACCES)
    return Fail("daemon",
                fmt::format("{} may not be used by {}", daemon.socket, facts.operator_user.name),
                fmt::format("usermod --append --groups GROUP {} with the group that "
                            "`ls -l {}` shows; then log in again",
                            facts.operator_user.name, daemon.socket));
  if (daemon.connect_error != 0)
    return Fail(
        "daemon",
        fmt::format("no daemon at {}: {}", daemon.socket, std::strerror(daemon.connect_error)),
        "systemctl start focalfleetd; journalctl -u focalfleetd says why it does not run");
  return Fail("daemon", daemon.silence + ": it hangs, or is stopped",
              "focalfleet stop --direct stops the units; systemctl restart focalfleetd");
}

Check JudgeVersion(const Facts& facts) {
  const std::string version = TextIn(facts.daemon.status, "version");
  if (version == facts.program_version)
    return Ok("version", fmt::format("daemon and command line are {}", version));
  return Warn("version",
              fmt::format("the daemon is {}, the command line {}", version, facts.program_version),
              "systemctl restart focalfleetd, when no configuration is under way");
}

Check JudgeAlarms(const Json& alarms) {
  const std::uint64_t open = CountIn(alarms, "open");
  if (open == 0) return Ok("alarms", "none is open");
  const std::string worst = TextIn(alarms, "worst");
  const std::string text =
      fmt::format("{} open{}", open, worst.empty() ? "" : ", the worst: " + worst);
  return worst == "error" ? Fail("alarms", text, "focalfleet alarms")
                          : Warn("alarms", text, "focalfleet alarms");
}

Check JudgeUnits(const Json& status) {
  const std::uint64_t enabled = CountIn(status, "enabled");
  const Json phases = MemberOf(status, "phases");
  const std::uint64_t away = CountIn(phases, "absent") + CountIn(phases, "silent");
  const std::uint64_t sick = CountIn(phases, "fault") + CountIn(phases, "foreign");
  if (away + sick == 0) return Ok("units", fmt::format("{} enabled, all answer", enabled));
  return Warn("units",
              fmt::format("without an answer: {}; with a fault or other hardware: {}", away, sick),
              "focalfleet status; focalfleet unit UNIT says why");
}

/// Frames that no unit of the fleet sends.
Check JudgeSenders(const Json& buses) {
  std::string where;
  std::uint64_t frames = 0;
  for (const Json& bus : buses) {
    const std::uint64_t strange = CountIn(bus, "rejected") + CountIn(bus, "malformed");
    if (strange == 0) continue;
    frames += strange;
    where += fmt::format("{}{}", where.empty() ? "" : ", ", CountIn(bus, "bus_id"));
  }
  if (frames == 0) return Ok("senders", "the daemon has seen no frame of other senders");
  return Warn(
      "senders",
      fmt::format("the daemon has seen {} frames of other senders, on bus {}", frames, where),
      "candump the bus | focalfleet can decode; take the other sender off it");
}

Check JudgeLinks(const Json& buses) {
  std::string down;
  for (const Json& bus : buses)
    if (TextIn(bus, "link") != "up")
      down += fmt::format("{}{} ({})", down.empty() ? "" : ", ", CountIn(bus, "bus_id"),
                          TextIn(bus, "trouble"));
  if (down.empty()) return Ok("buses", fmt::format("all {} are up", buses.size()));
  return Fail("buses", "not up: bus " + down,
              "focalfleet status --buses; mend the interfaces above");
}

}  // namespace

void JudgeDaemon(const Facts& facts, Checks* checks) {
  checks->push_back(JudgeAnswer(facts));
  if (!facts.daemon.silence.empty()) return;
  const Json& status = facts.daemon.status;
  checks->push_back(JudgeVersion(facts));
  if (const Json alarms = MemberOf(status, "alarms"); alarms.is_object())
    checks->push_back(JudgeAlarms(alarms));
  checks->push_back(JudgeUnits(status));
  const Json buses = MemberOf(status, "buses");
  checks->push_back(JudgeLinks(buses));
  checks->push_back(JudgeSenders(buses));
}

}  // namespace focalfleet::doctor
