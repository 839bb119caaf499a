#include "daemon/soak/operators.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "daemon/soak/virtual_time.h"
#include "fleet/kinematics.h"
#include "fleet/targets.h"

namespace focalfleet::soak {
namespace {

using enum FaultSite;

constexpr std::size_t kAnswersKept = 64;
constexpr DurationNs kAnsweredWithin = Seconds(30);
constexpr DurationNs kMovedWithin = Seconds(900);
/// Units that are homed unproven go one after the other.
constexpr DurationNs kHomedWithin = Seconds(60);

/// Pre: the host is not held up and the store writes.
DurationNs AnswerTakes(const std::string& verb, std::size_t units) {
  if (verb == "home")
    return kMovedWithin + DurationNs{static_cast<std::int64_t>(units) * kHomedWithin.ns};
  const bool plans =
      verb == "apply" || verb == "preview" || verb == "retarget" || verb == "measure";
  return plans ? kMovedWithin : kAnsweredWithin;
}

/// A model that explains nothing and changes nothing: all units are as described.
std::string ModelOf(const Layout& layout, std::uint64_t name) {
  std::string text = fmt::format(
      "name = \"model {}\"\ncampaign = \"night\"\nverdict = \"explained\"\nrms_before_um = "
      "54\nrms_after_um = 9\n",
      name);
  for (const Unit& unit : layout.units())
    text += fmt::format(
        "[[unit]]\nunit_id = {}\nbase_x_mm = {:.9f}\nbase_y_mm = {:.9f}\narm_theta_mm = "
        "{:.9f}\narm_phi_mm = {:.9f}\ntheta_zero_deg = {:.9f}\nphi_zero_deg = {:.9f}\n"
        "left_theta_deg = 0.0\nleft_phi_deg = 0.0\nadded_theta_deg = 0.0\nadded_phi_deg = 0.0\n",
        unit.id.value, unit.base_fp.x_mm, unit.base_fp.y_mm, unit.axis[0].arm_mm,
        unit.axis[1].arm_mm, unit.axis[0].zero_deg, unit.axis[1].zero_deg);
  return text;
}

}  // namespace

Operators::Operators(const Parts& parts)
    : parts_(parts),
      rng_(Rng::Stream(parts.draws->seed, "soak operators")),
      next_(HostInstant{ReadVirtualNs()} + Seconds(4)) {}

bool Operators::Wants(FaultSite site, double chance) {
  if (!parts_.draws->is(site) || rng_.Uniform() >= chance) return false;
  ++(*parts_.reached)[Index(site)];
  return true;
}

void Operators::Act(HostInstant now) {
  now_ = now;
  if (now < next_) return;
  const double mean_ns = static_cast<double>(parts_.draws->idle.ns);
  next_ = now + DurationNs{1 + static_cast<std::int64_t>(-mean_ns * std::log(1 - rng_.Uniform()))};
  ActAtRandom();
}

std::uint64_t Operators::Ask(const std::string& verb, Json args) {
  const std::uint64_t client = ++client_;
  open_[client] = {.verb = verb, .asked = HostInstant{ReadVirtualNs()}};
  if (args.contains("unit_id")) open_[client].unit = UnitId{args["unit_id"].get<std::uint32_t>()};
  if (args.contains("unit_ids") && args["unit_ids"].size() == 1)
    open_[client].unit = UnitId{args["unit_ids"][0].get<std::uint32_t>()};
  if (verb == "enable" || verb == "disable")
    for (const Json& unit : args["unit_ids"]) {
      open_[client].changes.push_back(unit.get<std::uint32_t>());
      newest_change_[open_[client].changes.back()] = client;
    }
  if (verb == "apply" || verb == "home" || verb == "retarget" || verb == "measure")
    parts_.judge->stops().MotionCommanded(HostInstant{ReadVirtualNs()});
  if (verb == "stop")
    parts_.judge->stops().Ordered(HostInstant{ReadVirtualNs()}, open_[client].unit);
  parts_.put(client, EncodeRequest({client, verb, std::move(args)}));
  return client;
}

const ControlAnswer* Operators::Answer(std::uint64_t request) const {
  const auto found = answers_.find(request);
  return found == answers_.end() ? nullptr : &found->second;
}

std::string Operators::DrawTargets(double share) {
  const Layout& layout = parts_.plant->layout();
  const std::vector<UnitDrive>& drives = parts_.plant->drives();
  const auto poses = DrawConfiguration(layout, drives, {}, Rng(rng_.Bits()));
  std::string csv = "unit_id,theta_deg,phi_deg\n";
  for (std::uint32_t n = 0; poses && n < layout.size(); ++n) {
    if (rng_.Uniform() >= share) continue;
    const AxisAngles angles = AnglesOf(layout.unit({n}), drives[n], (*poses)[n]);
    csv += fmt::format("{},{},{}\n", layout.unit({n}).id.value, angles.theta_deg, angles.phi_deg);
  }
  return csv;
}

Json Operators::OneUnit(UnitId* unit) {
  const auto& units = parts_.plant->layout().units();
  *unit = units[rng_.Below(units.size())].id;
  return {{"unit_ids", {unit->value}}};
}

void Operators::ActAtRandom() {
  UnitId unit;
  if (Wants(kOperatorStop, 0.15)) {
    Ask("stop", Json::object());
  } else if (Wants(kOperatorStopUnit, 0.1)) {
    OneUnit(&unit);
    Ask("stop", {{"unit_id", unit.value}});
  } else if (parts_.is_busy() && Wants(kOperatorRetarget, 0.4)) {
    OneUnit(&unit);
    Ask("retarget", {{"unit_id", unit.value},
                     {"theta_deg", rng_.Uniform(-180, 180)},
                     {"phi_deg", rng_.Uniform(0, 180)}});
  } else if (Wants(kOperatorHome, 0.2)) {
    if (rng_.Below(2) == 0)
      Ask("home", {{"not_known", true}});
    else
      Ask("home", OneUnit(&unit));
  } else if (Wants(kOperatorDisable, 0.2)) {
    Json args = OneUnit(&unit);
    if (rng_.Below(3) > 0) {
      Ask("enable", std::move(args));
    } else {
      args["reason"] = "for the soak";
      Ask("disable", std::move(args));
    }
  } else if (Wants(kOperatorParameter, 0.1)) {
    OneUnit(&unit);
    Ask("params_set", {{"unit_id", unit.value},
                       {"axis", rng_.Below(2) == 0 ? "theta" : "phi"},
                       {"parameter", "repeat"},
                       {"value", 108 + rng_.Below(3)}});
  } else if (Wants(kOperatorPreview, 0.2)) {
    Ask("preview", {{"targets_csv", DrawTargets(1)}});
  } else if (Wants(kOperatorModel, 0.3)) {
    ChangeModel();
  } else if (Wants(kOperatorGarbage, 0.3)) {
    std::string line(rng_.Below(200), ' ');
    for (char& c : line) c = static_cast<char>(1 + rng_.Below(255));
    open_[++client_] = {.verb = "garbage", .asked = now_};
    parts_.put(client_, line);
  } else if (Wants(kOperatorFlood, 0.1)) {
    for (const char* verb : {"status", "state", "alarms", "history", "events", "params", "model",
                             "unit", "measurements", "select"})
      for (int n = 0; n < 8; ++n) Ask(verb, {{"unit_id", 1 + rng_.Below(10)}});
  } else {
    const bool wait = rng_.Below(2) == 0;
    if (parts_.is_busy()) {
      if (!Wants(kOperatorBusy, 0.5)) return;
    }
    Json args{{"targets_csv", DrawTargets(rng_.Below(2) == 0 ? 1.0 : rng_.Uniform())},
              {"source", "soak"},
              {"wait", wait}};
    if (parts_.draws->camera && rng_.Below(2) == 0) args["corrections"] = rng_.Below(3);
    const std::uint64_t client = Ask("apply", std::move(args));
    if (Wants(kOperatorGone, 0.3)) open_[client].gone = true;
  }
}

void Operators::ChangeModel() {
  const std::uint64_t what = rng_.Below(4);
  if (what == 0) {
    Ask("model_unload", Json::object());
  } else if (what == 1) {
    Ask("model_rollback", Json::object());
  } else {
    Ask("model_load",
        {{"model_toml", ModelOf(parts_.plant->layout(), rng_.Below(3))}, {"source", "soak.toml"}});
  }
}

void Operators::LookForUnanswered(HostInstant now) {
  const HostInstant well_since = std::max(parts_.troubles->away, parts_.troubles->store);
  for (const auto& [client, open] : open_) {
    const DurationNs within = AnswerTakes(open.verb, parts_.plant->layout().size());
    if (open.gone || now < std::max(open.asked, well_since) + within) continue;
    parts_.judge->Broken(
        "answer", fmt::format("request {} ({}) has no answer since {:.1f} s", client, open.verb,
                              1e-9 * static_cast<double>((now - open.asked).ns)));
    return;
  }
}

void Operators::LookAtEnd(HostInstant now) {
  constexpr DurationNs kPause = Seconds(2);
  for (const auto& [client, open] : open_)
    if (!open.gone && now - open.asked > kPause)
      return parts_.judge->Broken(
          "answer", fmt::format("request {} ({}) was never answered", client, open.verb));
}

bool Operators::Hear(std::uint64_t client, std::string_view line, bool last) {
  const auto found = open_.find(client);
  if (found == open_.end() || found->second.gone) return false;
  if (!last) return true;
  for (const char c : line) digest_ = (digest_ ^ static_cast<unsigned char>(c)) * 0x100000001b3u;
  ++answered_;
  auto answer = DecodeAnswer(line);
  if (!answer) {
    parts_.judge->Broken("answer", "a line that is no answer: " + answer.error().text);
  } else {
    CheckAnswer(client, found->second, *answer);
    if (answers_.size() >= kAnswersKept) answers_.erase(answers_.begin());
    answers_[client] = std::move(*answer);
  }
  open_.erase(found);
  return true;
}

/// A change that is answered with success is in the store. Somebody else may ask for the opposite
/// before the answer comes, as when the host stood still: one commit then has both.
void Operators::CheckAnswer(std::uint64_t client, const Open& open, const ControlAnswer& answer) {
  if (answer.kind != ControlAnswer::Kind::kResult) return;
  if (open.verb == "stop" && !open.unit)
    parts_.judge->stops().AllStopped(open.asked, HostInstant{ReadVirtualNs()});
  const auto& units = parts_.judge->acknowledged().units;
  for (const std::uint32_t id : open.changes) {
    if (newest_change_[id] != client) continue;
    const auto unit = units.find(id);
    const bool enabled = unit == units.end() || unit->second.enabled;
    if (enabled != (open.verb == "enable"))
      parts_.judge->Broken("reported",
                           fmt::format("{} of unit {} is answered and not stored", open.verb, id));
  }
}

}  // namespace focalfleet::soak
