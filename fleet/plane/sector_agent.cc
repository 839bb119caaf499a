#include "fleet/plane/sector_agent.h"

#include <algorithm>
#include <utility>

#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

constexpr DurationNs kClosely = Milliseconds(500);     // before a start is decided
constexpr DurationNs kAfterStart = Milliseconds(250);  // whoever starts has said so
constexpr DurationNs kUnorderedMost = Seconds(1e6);

}  // namespace

SectorAgent::SectorAgent(const SectorAgentConfig& config, std::uint64_t incarnation,
                         PlaneEpoch kept)
    : config_(config), incarnation_(incarnation), accepted_(kept) {}

HostInstant SectorAgent::Own(HostInstant plane) const {
  return plane == kNever || plane.ns == INT64_MIN ? plane : plane + round_.ahead;
}
HostInstant SectorAgent::Plane(HostInstant own) const {
  return own == kNever || own.ns == INT64_MIN ? own : own - round_.ahead;
}

void SectorAgent::Send(decltype(Command::what) what) {
  out_->commands.push_back({kRequest, std::move(what)});
}

void SectorAgent::Step(const AgentInputs& inputs, AgentEffects* effects) {
  in_ = &inputs;
  out_ = effects;
  if (inputs.kept > accepted_) {
    accepted_ = inputs.kept;
    order_.reset();
    done_ = 0;
    // A start of the earlier epoch that is not confirmed yet is void.
    if (Holds()) GiveBack("another coordinator took over");
  }
  for (const PlaneOrder& order : inputs.orders) Hear(order);
  Follow();
  for (const BorderNews& news : inputs.news) Hear(news);
  Obey();
  Confirm();
  Watch();
  Publish();
  in_ = nullptr;
  out_ = nullptr;
}

// ---- orders

void SectorAgent::Hear(const PlaneOrder& order) {
  if (order.sector != config_.sector) return;
  if (order.epoch < accepted_) {
    ++refused_;
    return;
  }
  if (order.epoch > accepted_) {
    // Nothing of the new epoch is done, or said to be, before it is durable.
    if (!out_->keep || *out_->keep < order.epoch) out_->keep = order.epoch;
    return;
  }
  ordered_at_ = in_->now;
  if (silence_said_)
    out_->notes.push_back({AlarmName::kPlaneHeard, "the plane's coordinator is heard again",
                           AlarmName::kPlaneSilent});
  silence_said_ = false;
  if (!(echo_.sent == order.sent)) echo_ = {order.sent, in_->now, {}};
  if (order.incarnation != 0 && order.incarnation != incarnation_) return;
  job_seen_ = order.job_seen;
  places_.seen = order.places_seen;
  exposure_seen_ = order.exposure_seen;
  const bool newer = !order_ || order.number > order_->number;
  const bool same = order_ && order.number == order_->number;
  if (newer || (same && (order.task != nullptr || order.round_body != nullptr ||
                         order.findings != nullptr))) {
    order_ = order;
  } else if (same) {
    order_->ahead = order.ahead;
  }
}

/// Takes in how far the sector's own coordinator has come.
void SectorAgent::Follow() {
  const AgentInputs& in = *in_;
  if (in.job != nullptr && in.view.stage == SectorStage::kAsking) {
    auto job = std::make_shared<SectorJob>();
    *job = {.job = in.job->job,
            .start = in.job->start,
            .targets = in.job->targets,
            .frozen = in.job->frozen,
            .offsets = in.job->offsets,
            .drives = {in.drives.begin(), in.drives.end()},
            .to_home = in.job->to_home,
            .unproven = in.job->unproven,
            .fixed = in.job->options.fixed,
            .leave_stuck = in.job->options.leave_stuck,
            .start_skew_s = in.job->options.start_skew_s,
            .notice_s = in.job->options.notice_s};
    job_ = std::move(job);
    said_.changed = true;
  }
  if (in.exposure != nullptr) {
    auto exposure = std::make_shared<SectorExposure>();
    *exposure = {.id = in.exposure->id,
                 .first = in.view.looks_first,
                 .expected = in.exposure->expected,
                 .before = in.exposure->before,
                 .reported = in.exposure->reported,
                 .seen = in.exposure->seen,
                 .wanted = in.exposure->wanted,
                 .tolerance_um = in.exposure->tolerance_um,
                 .drives = {in.drives.begin(), in.drives.end()}};
    exposure_ = std::move(exposure);
    said_.changed = true;
  }
  if (in.view.stage != SectorStage::kIdle) {  // places of before are none any more
    places_.now.reset();
    places_.digest = 0;
  } else if (in.places != nullptr) {
    places_.now = in.places;
    places_.digest = DigestOf(*in.places);
  }
  for (const ReplyEffect& reply : in.replies) {
    if (reply.request != kRequest || !reply.error) continue;
    here_.trouble = reply.error->text;
    if (here_.now.number != 0 && !here_.begun) {  // the configuration was not taken
      here_.last = std::exchange(here_.now, {});
      here_.last_state = ConfigurationState::kFailed;
    }
    said_.changed = true;
  }
  if (here_.now.number != 0 && in.view.stage != SectorStage::kIdle) here_.begun = true;
  if (here_.begun && in.view.stage == SectorStage::kIdle) {
    here_.last = std::exchange(here_.now, {});
    here_.last_state = in.configuration->state;
    here_.begun = false;
    said_.changed = true;
  }
  // The round is over where the sector has gone on to another job, or to the end.
  const bool same_job = in.view.job == round_.job;
  const bool moves = in.view.stage == SectorStage::kMoving && same_job;
  if (round_.course == Course::kStarted && moves != round_.began) {
    // Its coordinator takes a start in the step that follows the order, or not at all.
    round_.course = moves ? Course::kStarted : round_.began ? Course::kOver : Course::kNone;
    round_.began = moves;
    said_.news_changed = said_.changed = true;
  } else if (round_.course == Course::kStarted && !moves) {
    round_.course = Course::kNone;
    said_.news_changed = said_.changed = true;
  }
  if (Holds() &&
      (!same_job || in.view.stage == SectorStage::kIdle || in.view.stage == SectorStage::kEnding)) {
    round_.course = Course::kNone;
    said_.news_changed = said_.changed = true;
  }
  if (round_.course == Course::kStarted || round_.course == Course::kOver)
    for (const BorderEnd& end : in.ends) {
      if (round_.ends.size() < limits::kBorderEnds)
        round_.ends.push_back({end.leader, Plane(end.from), Plane(end.until)});
      said_.news_changed = true;
    }
}

void SectorAgent::Obey() {
  if (!order_ || order_->number <= done_) return;
  if (!Do(*order_)) return;
  done_ = order_->number;
  order_->task.reset();
  order_->round_body.reset();
  order_->findings.reset();
  said_.changed = true;
}

/// True: the order is carried out, or came too late for that.
bool SectorAgent::Do(const PlaneOrder& order) {
  switch (order.kind) {
    case OrderKind::kStand:
      return true;
    case OrderKind::kConfigure:
      return Configure(order);
    case OrderKind::kRound:
      return TakeRound(order);
    case OrderKind::kStart:
      if (round_.course != Course::kHeld || round_.number != order.round ||
          in_->view.stage != SectorStage::kReady || in_->view.job != order.job)
        return true;
      if (!order.ahead) return false;
      round_.course = Course::kConfirming;
      round_.start_at = order.start_at;
      round_.ahead = *order.ahead;
      said_.news_changed = true;
      return true;
    case OrderKind::kWithdraw:
      if (!Holds()) return true;  // it moves, or is over
      round_.course = Course::kNone;
      said_.news_changed = true;
      Send(SectorWithdrawCommand{order.job});
      return true;
    case OrderKind::kStop:
      if (Holds()) round_.course = Course::kNone;
      said_.news_changed = true;
      Send(StopCommand{});
      return true;
    case OrderKind::kRetarget:
      return Retarget(order);
    case OrderKind::kFindings:
      if (in_->view.stage != SectorStage::kLooking || exposure_ == nullptr ||
          exposure_->id != order.job)
        return true;
      if (order.findings == nullptr) return false;
      Send(SectorFindings{order.job, *order.findings});
      return true;
  }
  return true;
}

bool SectorAgent::Configure(const PlaneOrder& order) {
  if (order.configuration == here_.now || order.configuration == here_.last) return true;
  if (in_->view.stage != SectorStage::kIdle || order.task == nullptr) return false;
  here_.now = order.configuration;
  here_.change = order.change;
  here_.begun = false;
  here_.trouble.clear();
  round_ = {};
  Send(*order.task);
  return true;
}

/// A change is carried out once, however often it is ordered.
bool SectorAgent::Retarget(const PlaneOrder& order) {
  if (order.configuration != here_.now) return true;
  if (!here_.begun) return false;
  SectorRetargetCommand command;
  for (const SectorRetarget& retarget : order.retargets)
    if (retarget.number > here_.change) command.targets.push_back(retarget.target);
  here_.change = std::max(here_.change, order.change);
  if (!command.targets.empty()) Send(std::move(command));
  return true;
}

bool SectorAgent::TakeRound(const PlaneOrder& order) {
  if (in_->view.stage != SectorStage::kAsking || in_->view.job != order.job) return true;
  if (order.round_body == nullptr) return false;
  round_ = {};
  round_.epoch = order.epoch;
  round_.number = order.round;
  round_.job = order.job;
  round_.held_since = in_->now;
  round_.body = order.round_body;
  for (const std::uint32_t sector : order.together) round_.together[sector] = {};
  if (!order.round_body->moves.empty() || !order.round_body->homing.empty())
    round_.course = Course::kHeld;
  said_.news_changed = true;
  Send(*order.round_body);
  return true;
}

// ---- the common start

void SectorAgent::Hear(const BorderNews& news) {
  if (news.epoch != round_.epoch || news.round != round_.number || round_.number == 0) {
    // A neighbour of this round that has begun another life, or follows another coordinator.
    const auto it = round_.together.find(news.sector);
    if (it == round_.together.end() || !it->second.last) return;
    const BorderNews& last = *it->second.last;
    if (news.incarnation < last.incarnation ||
        (news.incarnation == last.incarnation && news.number < last.number))
      return;
    // Where it has started, its units finish by themselves.
    if (last.stage == BorderStage::kHolding) it->second.last->stage = BorderStage::kOut;
    return;
  }
  const auto it = round_.together.find(news.sector);
  if (it == round_.together.end()) return;
  Neighbour& from = it->second;
  if (from.last && news.incarnation == from.last->incarnation && news.number <= from.last->number)
    return;
  from.last = news;
  from.heard = in_->now;
}

/// Names a neighbour that keeps this sector from starting; empty: none.
std::string SectorAgent::WhoIsMissing() const {
  for (const auto& [sector, from] : round_.together) {
    if (!from.last || in_->now - from.heard > config_.confirm_fresh)
      return NameOfSector(sector) + " is not heard";
    const BorderNews& last = *from.last;
    if (last.stage == BorderStage::kOut || !(last.start_at == round_.start_at))
      return NameOfSector(sector) + " does not hold the round";
    if (std::ranges::find(last.heard, config_.sector) == last.heard.end())
      return NameOfSector(sector) + " does not hear this one";
  }
  return {};
}

void SectorAgent::Confirm() {
  if (round_.course == Course::kHeld && in_->now - round_.held_since > config_.hold_limit &&
      (!ordered_at_ || in_->now - *ordered_at_ > config_.hold_limit))
    return GiveBack("the plane's coordinator is not heard");
  if (round_.course != Course::kConfirming) return;
  const HostInstant start = Own(round_.start_at);
  const HostInstant last_word = start - config_.start_delay;
  if (in_->now < last_word) {
    out_->wake_at = std::min(out_->wake_at, last_word);
    if (in_->now + kClosely < last_word)
      out_->wake_at = std::min(out_->wake_at, last_word - kClosely);
    return;
  }
  const bool late = in_->now > last_word + DurationNs{config_.start_delay.ns / 4};
  const std::string missing = late ? "this host was late" : WhoIsMissing();
  if (!missing.empty()) return GiveBack(missing);
  round_.course = Course::kStarted;
  said_.news_changed = said_.changed = true;
  Send(SectorStartCommand{round_.job, start});
}

void SectorAgent::GiveBack(const std::string& why) {
  round_.course = Course::kNone;
  said_.news_changed = said_.changed = true;
  here_.trouble = "the round was given back: " + why;
  out_->notes.push_back({AlarmName::kSectorStartMissed, here_.trouble});
  Send(SectorWithdrawCommand{round_.job});
}

// ---- the border in motion

void SectorAgent::StopBeyond(std::uint32_t sector, HostInstant from, HostInstant until,
                             std::string reason) {
  BorderEndCommand end{{}, from, until, std::move(reason)};
  for (const SectorRound::FollowsBeyond& follows : round_.body->follows)
    if (follows.sector == sector) end.leaders.push_back(follows.leader);
  if (!end.leaders.empty()) Send(std::move(end));
}

void SectorAgent::Watch() {
  if (round_.course != Course::kStarted) return;
  const HostInstant start = Own(round_.start_at);
  for (auto& [sector, from] : round_.together) {
    const BorderNews* const last = from.last ? &*from.last : nullptr;
    if (last != nullptr)
      for (; from.ends_taken < last->ends.size(); ++from.ends_taken) {
        const BorderEnd& end = last->ends[from.ends_taken];
        Send(BorderEndCommand{{end.leader},
                              Own(end.from),
                              Own(end.until),
                              "unit " + std::to_string(end.leader.value) + " of " +
                                  NameOfSector(sector) + " may stand in its way"});
      }
    if (last == nullptr || last->stage == BorderStage::kOver || from.stands) continue;
    const bool holds_still = last->stage == BorderStage::kHolding && in_->now > start + kAfterStart;
    const bool silent = in_->now - from.heard > config_.suspicion;
    if (last->stage == BorderStage::kOut || (holds_still && !silent)) {
      from.stands = true;
      out_->notes.push_back({AlarmName::kSectorSilent,
                             NameOfSector(sector) + " has not started: units that would come "
                                                    "where its units stand are stopped"});
      StopBeyond(sector, HostInstant{INT64_MIN}, kNever, NameOfSector(sector) + " has not started");
    } else if (silent && !from.lost) {
      from.lost = true;
      out_->notes.push_back({AlarmName::kSectorSilent,
                             NameOfSector(sector) + " is not heard in motion: if a unit at the "
                                                    "border ends early, it is not noticed beyond"});
    }
    if (!silent)
      out_->wake_at = std::min(out_->wake_at, from.heard + config_.suspicion + Milliseconds(1));
  }
}

// ---- reports and news

SectorReport SectorAgent::Report() const {
  const AgentInputs& in = *in_;
  const bool holds = (Holds() || round_.course == Course::kStarted) && in.view.job == round_.job;
  SectorReport report{.sector = config_.sector,
                      .incarnation = incarnation_,
                      .layout = config_.layout,
                      .number = said_.number,
                      .accepted = accepted_,
                      .unordered = ordered_at_ ? in.now - *ordered_at_ : kUnorderedMost,
                      .order = done_,
                      .stage = in.view.stage,
                      .configuration = here_.now,
                      .change = here_.change,
                      .job = in.view.job,
                      .round = holds ? round_.number : 0,
                      .last_over = here_.last,
                      .last_state = here_.last_state,
                      .counts = in.configuration->counts,
                      .start_delay_s = config_.start_delay.seconds(),
                      .trouble = here_.trouble,
                      .door = config_.door};
  if (ordered_at_) {
    report.echo = echo_;
    report.echo->returned = in.now;
  }
  if (in.view.stage == SectorStage::kAsking && job_ != nullptr && job_->job == in.view.job &&
      job_seen_ != job_->job)
    report.body = job_;
  report.places_now = places_.digest;
  if (in.view.stage == SectorStage::kIdle && places_.seen != places_.digest)
    report.places = places_.now;
  if (in.view.stage == SectorStage::kLooking && exposure_ != nullptr &&
      exposure_seen_ != exposure_->id)
    report.exposure = exposure_;
  return report;
}

BorderNews SectorAgent::News() const {
  BorderNews news{.sector = config_.sector,
                  .incarnation = incarnation_,
                  .number = said_.number,
                  .epoch = round_.epoch,
                  .round = round_.number,
                  .stage = BorderStage::kOut,
                  .start_at = round_.start_at,
                  .heard = {},
                  .ends = round_.ends};
  if (round_.course == Course::kConfirming) news.stage = BorderStage::kHolding;
  if (round_.course == Course::kStarted) news.stage = BorderStage::kStarted;
  if (round_.course == Course::kOver) news.stage = BorderStage::kOver;
  for (const auto& [sector, from] : round_.together)
    if (from.last && from.last->stage != BorderStage::kOut &&
        in_->now - from.heard <= config_.confirm_fresh)
      news.heard.push_back(sector);
  return news;
}

void SectorAgent::Publish() {
  const HostInstant now = in_->now;
  if (ordered_at_ && !silence_said_ && now - *ordered_at_ > config_.plane_silence) {
    silence_said_ = true;
    out_->notes.push_back({AlarmName::kPlaneSilent,
                           "the plane's coordinator is not heard; what moves finishes, and "
                           "nothing else begins"});
  }
  ++said_.number;
  if (in_->view.stage != said_.stage || in_->view.job != said_.job) said_.changed = true;
  if (said_.changed || now >= said_.report + config_.report_period) {
    out_->report = Report();
    said_.report = now;
    said_.stage = in_->view.stage;
    said_.job = in_->view.job;
    said_.changed = false;
  }
  const bool speaks = round_.number != 0 && !round_.together.empty();
  const bool closely = round_.course == Course::kConfirming &&
                       now + kClosely >= Own(round_.start_at) - config_.start_delay;
  const DurationNs period = closely ? config_.confirm_period : config_.news_period;
  if (speaks && (said_.news_changed || now >= said_.news + period)) {
    out_->news = News();
    said_.news = now;
  }
  said_.news_changed = false;
  out_->wake_at = std::min(out_->wake_at, said_.report + config_.report_period);
  if (speaks) out_->wake_at = std::min(out_->wake_at, said_.news + period);
}

}  // namespace focalfleet
