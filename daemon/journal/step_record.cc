#include "daemon/journal/step_record.h"

#include <fmt/format.h>

#include <utility>

#include "daemon/journal/fields.h"
#include "fleet/plan/job.h"

namespace focalfleet::journal {
namespace {

/// A plan as it is recorded: the planner makes it again of its job, or the reason why there is
/// none.
struct RecordedPlan {
  std::uint64_t job = 0;
  std::optional<Error> error;
  std::uint64_t given_up_at_look = 0;
};

/// Inputs that own what they name.
struct RecordedInputs {
  HostInstant now;
  std::vector<ReceivedFrame> frames;
  std::vector<LinkEvent> links;
  std::vector<Command> commands;
  std::vector<RecordedPlan> plans;
  std::vector<ExposureDone> exposures;
  std::vector<ShellNote> notes;
  std::uint64_t committed_through = 0;
  bool store_failing = false;
  std::vector<RefusedRow> refused;
};

/// Parts of the effects, each with a digest of its own, so that a difference has a name.
struct EffectsDigest {
  std::uint64_t rows = 0;
  std::uint64_t frames = 0;
  std::uint64_t jobs = 0;
  std::uint64_t replies = 0;
  std::uint64_t rest = 0;
};

std::uint64_t Fnv(const std::string& bytes) {
  std::uint64_t digest = 0xcbf29ce484222325u;
  for (const char byte : bytes)
    digest = (digest ^ static_cast<unsigned char>(byte)) * 0x100000001b3u;
  return digest;
}

template <class... T>
std::uint64_t DigestOfAll(const T&... values) {
  std::string bytes;
  (WriteFields(values, &bytes), ...);
  return Fnv(bytes);
}

EffectsDigest PartsOf(const Effects& effects) {
  std::string job, exposure;
  if (effects.plan_job) {
    const PlanJob& plan = *effects.plan_job;
    for (const auto& part : {plan.job, static_cast<std::uint64_t>(plan.purpose),
                             static_cast<std::uint64_t>(plan.late != nullptr)})
      WriteFields(part, &job);
    WriteFields(plan.start, &job);
    WriteFields(plan.targets, &job);
    WriteFields(plan.frozen, &job);
    WriteFields(plan.offsets, &job);
    WriteFields(plan.to_home, &job);
  }
  if (effects.exposure) WriteFields(*effects.exposure, &exposure);
  return {
      .rows = DigestOfAll(effects.batch, effects.rows),
      .frames = DigestOfAll(effects.frames),
      .jobs = DigestOfAll(job, exposure),
      .replies = DigestOfAll(effects.replies),
      .rest = DigestOfAll(effects.sync_at, effects.changed, effects.border_ends, effects.wake_at)};
}

template <class T>
std::vector<T> Owned(std::span<const T> list) {
  return {list.begin(), list.end()};
}

}  // namespace

std::uint64_t DigestOf(const Effects& effects) { return DigestOfAll(PartsOf(effects)); }

std::string RecordOf(const Inputs& inputs, const Effects& effects) {
  RecordedInputs owned{.now = inputs.now,
                       .frames = Owned(inputs.frames),
                       .links = Owned(inputs.links),
                       .commands = Owned(inputs.commands),
                       .plans = {},
                       .exposures = Owned(inputs.exposures),
                       .notes = Owned(inputs.notes),
                       .committed_through = inputs.committed_through,
                       .store_failing = inputs.store_failing,
                       .refused = Owned(inputs.refused)};
  for (const PlanDone& plan : inputs.plans) {
    owned.plans.push_back({plan.job, {}, plan.given_up_at_look});
    if (plan.late && !*plan.late)
      owned.plans.back().error = plan.late->error();
    else if (!plan.plan)
      owned.plans.back().error = plan.plan.error();
  }
  std::string bytes;
  WriteFields(owned, &bytes);
  WriteFields(PartsOf(effects), &bytes);
  return bytes;
}

Replayer::Replayer(Start start)
    : layout_(start.layout),
      plan_limits_(start.plan_limits),
      coordinator_(std::make_unique<Coordinator>(start.layout, std::move(start.drives),
                                                 start.config, std::move(start.stored))) {}
Replayer::~Replayer() = default;

Status Replayer::Step(std::string_view record) {
  RecordedInputs inputs;
  EffectsDigest recorded;
  ByteReader reader{record};
  ReadFields(&reader, &inputs);
  ReadFields(&reader, &recorded);
  if (!reader.good || !reader.left.empty())
    return Fail(ErrorCode::kInvalid, fmt::format("record {} cannot be read", steps_ + 1));
  std::vector<PlanDone> plans;
  for (const RecordedPlan& plan : inputs.plans) {
    const auto job = jobs_.find(plan.job);
    if (job == jobs_.end())
      return Fail(ErrorCode::kInvalid,
                  fmt::format("record {} has the answer to a job that nobody gave", steps_ + 1));
    Abandoned given_up;
    if (plan.given_up_at_look != 0)
      given_up = [look = std::uint64_t{0}, last = plan.given_up_at_look]() mutable {
        return ++look >= last;
      };
    plans.push_back(plan.error
                        ? PlanFailed(job->second.job, *plan.error)
                        : RunPlanJob(job->second.job, *layout_, job->second.drives, given_up));
    jobs_.erase(job);
  }
  effects_.Clear();
  coordinator_->Step({.now = inputs.now,
                      .frames = inputs.frames,
                      .links = inputs.links,
                      .commands = inputs.commands,
                      .plans = plans,
                      .exposures = inputs.exposures,
                      .notes = inputs.notes,
                      .committed_through = inputs.committed_through,
                      .store_failing = inputs.store_failing,
                      .refused = inputs.refused},
                     &effects_);
  ++steps_;
  const EffectsDigest now = PartsOf(effects_);
  now_ = inputs.now;
  if (effects_.plan_job) {
    const auto drives = coordinator_->drives();
    GivenJob given{*effects_.plan_job, {drives.begin(), drives.end()}};
    if (plan_limits_.any()) given.job.options.power = plan_limits_;
    jobs_[effects_.plan_job->job] = std::move(given);
  }
  const std::pair<const char*, bool> parts[] = {{"rows", now.rows != recorded.rows},
                                                {"frames", now.frames != recorded.frames},
                                                {"jobs", now.jobs != recorded.jobs},
                                                {"replies", now.replies != recorded.replies},
                                                {"times and changes", now.rest != recorded.rest}};
  for (const auto& [what, differs] : parts)
    if (differs)
      return Fail(ErrorCode::kRefused,
                  fmt::format("step {} at {:.6f} s decides other {}", steps_,
                              1e-9 * static_cast<double>(inputs.now.ns), what));
  return {};
}

}  // namespace focalfleet::journal
