#include "sim/campaigns/diagnosis/model/model.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "sim/campaigns/effects/closed_loop.h"
#include "sim/campaigns/effects/empirical.h"
#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

constexpr std::size_t kChunksMax = 32;

void AddEvents(const CampaignModel& model, std::size_t unit, const UnitTrack& track,
               PoseErrors* errors) {
  for (const EventTerm& event : model.events) {
    if (event.unit != unit) continue;
    const std::size_t begin = event.row - track.first_row;
    const std::size_t end = event.stays ? EndOfStep(track, begin) : begin + 1;
    for (std::size_t i = begin; i < end; ++i) errors->angle_deg[event.axis][i] += event.step_deg;
  }
}

void AddImage(const ExposureTerm& image, const PlacePoint& at, double* x_mm, double* y_mm) {
  *x_mm +=
      image.shift_x_um * 1e-3 + image.scale_ppm * 1e-6 * at.x_mm - image.turn_urad * 1e-6 * at.y_mm;
  *y_mm +=
      image.shift_y_um * 1e-3 + image.scale_ppm * 1e-6 * at.y_mm + image.turn_urad * 1e-6 * at.x_mm;
}

// The reason why these moves cannot test the term; empty where they can.
std::string WhyNotTestable(const Template& form, const CampaignFacts& facts) {
  const bool empirical = FindEmpirical(form.effect->cause) != nullptr;
  std::string_view missing = MissingCovariate(*form.effect, facts);
  if (empirical && !facts.Has(form.covariate)) missing = form.covariate;
  if (!missing.empty()) return "column " + std::string(missing) + " is missing";
  if (empirical) return {};
  // The effect's own list checks what a form needs beyond its effect's columns.
  return IsOffered(form, facts) ? "" : "these units or moves have no such part";
}

}  // namespace

std::vector<NotTestable> LeaveOutUntestable(const CampaignFacts& facts, CampaignModel* model) {
  std::vector<NotTestable> left_out;
  std::erase_if(model->terms, [&](const ModelTerm& term) {
    const std::string why = WhyNotTestable(term.form, facts);
    if (!why.empty()) left_out.push_back({std::string(term.form.effect->cause), why});
    return !why.empty();
  });
  return left_out;
}

ParallelFor OneAfterTheOther() {
  return [](std::size_t chunks, const std::function<void(std::size_t)>& work) {
    for (std::size_t chunk = 0; chunk < chunks; ++chunk) work(chunk);
  };
}

std::span<const double> ModelTerm::AmplitudeOf(std::size_t unit) const {
  const std::uint32_t group = group_of_unit[unit];
  if (group == kNoGroup) return {};
  return std::span(amplitude).subspan(group * form.columns, form.columns);
}

std::string_view Name(Sharing sharing) {
  switch (sharing) {
    case Sharing::kRail:
      return "rail";
    case Sharing::kBus:
      return "bus";
    case Sharing::kFleet:
      return "fleet";
    case Sharing::kUnit:
      break;
  }
  return "unit";
}

// Groups differ by more than their errors: each has an amplitude of its own about the mean. The
// spread between them is that of the moments of their scatter.
// Source: DerSimonian and Laird, Controlled Clinical Trials 7 (1986) 177.
AmplitudeSummary Summarise(const ModelTerm& term) {
  constexpr double kByDataMin = 0.1;  // of an amplitude, by the data; the rest is the prior's
  if (term.has_mean && term.mean_sigma > 0) return {term.mean, term.mean_sigma};
  const std::size_t c = term.form.columns;
  struct Group {
    double value = 0;  // of one column; of several their root sum of squares
    double sigma2 = 0;
  };
  std::set<std::uint32_t> groups;
  for (const std::uint32_t group : term.group_of_unit)
    if (group != kNoGroup) groups.insert(group);
  std::vector<Group> own;
  for (const std::uint32_t group : groups) {
    double square = 0, sigma2 = 0;
    bool tells = false;
    for (std::size_t k = 0; k < c; ++k) {
      const double a = term.amplitude[group * c + k], sigma = term.sigma[group * c + k];
      // The prior draws an amplitude towards its middle: each counts as the data alone have it.
      const double by_data = term.spread > 0 ? 1 - std::pow(sigma / term.spread, 2) : 1;
      if (by_data < kByDataMin) continue;
      tells = true;
      square += std::pow(a / by_data, 2);
      sigma2 += sigma * sigma / by_data / static_cast<double>(c);
    }
    if (!tells) continue;
    own.push_back(
        {c == 1 ? std::copysign(std::sqrt(square), term.amplitude[group]) : std::sqrt(square),
         sigma2});
  }
  // A group without an error has no data. Where none has one, nothing is known of the errors.
  const bool known = std::ranges::any_of(own, [](const Group& group) { return group.sigma2 > 0; });
  if (known) std::erase_if(own, [](const Group& group) { return !(group.sigma2 > 0); });
  if (own.empty()) return {};
  if (!known)
    for (Group& group : own) group.sigma2 = 1;
  const auto mean_of = [&](double between2, const auto& value) {
    double sum = 0, weight = 0;
    for (const Group& group : own)
      sum += value(group) / (group.sigma2 + between2), weight += 1 / (group.sigma2 + between2);
    return AmplitudeSummary{sum / weight, 1 / std::sqrt(weight)};
  };
  const auto itself = [](const Group& group) { return group.value; };
  const AmplitudeSummary equal = mean_of(0, itself);
  double scatter = 0, weight = 0, weight2 = 0;
  for (const Group& group : own) {
    scatter += std::pow(group.value - equal.value, 2) / group.sigma2;
    weight += 1 / group.sigma2, weight2 += 1 / (group.sigma2 * group.sigma2);
  }
  const double freedom = static_cast<double>(own.size()) - 1;
  const double room = weight - weight2 / weight;  // none where one group has all of the weight
  const double between2 =
      freedom > 0 && room > 1e-9 * weight ? std::max((scatter - freedom) / room, 0.0) : 0;
  AmplitudeSummary mean = mean_of(between2, itself);
  if (!known) mean.sigma = 0;
  // Errors add to the length of several columns: the mean square less theirs is that of the truth.
  if (c > 1) {
    const AmplitudeSummary square = mean_of(between2, [&](const Group& group) {
      return group.value * group.value - static_cast<double>(c) * group.sigma2;
    });
    return {known ? std::sqrt(std::max(square.value, 0.0)) : mean.value, mean.sigma};
  }
  // Groups of either sign have no mean to speak of, and a size.
  const AmplitudeSummary square =
      mean_of(between2, [](const Group& group) { return group.value * group.value; });
  const double rms = std::sqrt(square.value);
  return {std::abs(mean.value) > 0.3 * rms ? mean.value : rms, mean.sigma};
}

std::vector<UnitChunk> ChunksOf(std::size_t units) {
  const std::size_t chunks = std::min(units, kChunksMax);
  std::vector<UnitChunk> out;
  for (std::size_t k = 0; k < chunks; ++k)
    out.push_back({units * k / chunks, units * (k + 1) / chunks});
  return out;
}

std::vector<Homing> FreeHomingsOf(const CampaignModel& model, const UnitTrack& track) {
  std::vector<Homing> homings;
  if (model.homing_zero_deg[kTheta].empty()) return homings;
  for (const std::size_t axis : {kTheta, kPhi})
    for (std::size_t begin = 0; begin < track.moves;) {
      const std::size_t end = EndOfHistory(track, begin);
      homings.push_back({axis, begin, end});
      begin = end;
    }
  return homings;
}

std::size_t MovesWithEvents(const CampaignModel& model) {
  std::set<std::size_t> rows;
  for (const EventTerm& event : model.events) rows.insert(event.row);
  return rows.size();
}

void ApplyHoming(const UnitTrack& track, const Homing& homing, PoseErrors* errors) {
  errors->Reset(track.moves);
  for (std::size_t i = homing.begin; i < homing.end; ++i) errors->angle_deg[homing.axis][i] = 1;
}

bool ApplyFrame(const UnitTrack& track, std::size_t frame, std::size_t parameter,
                PoseErrors* errors) {
  errors->Reset(track.moves);
  FrameTerm one{};
  one[parameter] = 1;
  const ExposureTerm image{one[0], one[1], one[2], one[3]};
  bool has_rows = false;
  for (std::size_t i = 0; i < track.moves; ++i) {
    if (track.facts->frames.of_row[track.RowOf(i)] != frame) continue;
    has_rows = true;
    AddImage(image, {track.fibre_x_mm[i], track.fibre_y_mm[i]}, &errors->x_mm[i], &errors->y_mm[i]);
  }
  return has_rows;
}

void AddPoseErrors(const CampaignModel& model, std::size_t unit, const UnitTrack& track,
                   PoseErrors* errors) {
  for (const ModelTerm& term : model.terms) {
    const std::span<const double> amplitude = term.AmplitudeOf(unit);
    if (!amplitude.empty()) AddErrors(track, term.form, amplitude, errors);
  }
  for (const Discrepancy& discrepancy : model.discrepancies)
    AddDiscrepancy(track, discrepancy, unit, errors);
  for (const std::size_t axis : {kTheta, kPhi}) {
    if (track.beginnings != nullptr)
      for (std::size_t i = 0; i < track.moves; ++i)
        errors->angle_deg[axis][i] += track.beginnings->begin_error_deg[axis][i];
    if (model.homing_zero_deg[axis].empty()) continue;
    for (std::size_t i = 0; i < track.moves; ++i)
      errors->angle_deg[axis][i] += model.homing_zero_deg[axis][track.first_row + i];
  }
  AddEvents(model, unit, track, errors);
}

UnitTrack TrackOf(const CampaignModel& model, const CampaignFacts& facts, std::size_t unit) {
  UnitTrack track = MakeTrack(facts, unit, model.units[unit]);
  const bool stepped =
      std::ranges::find(model.events, unit, &EventTerm::unit) != model.events.end();
  if (!stepped && !model.large_errors) return track;
  PoseErrors errors;
  errors.Reset(track.moves);
  if (model.large_errors)
    AddPoseErrors(model, unit, track, &errors);
  else
    AddEvents(model, unit, track, &errors);
  TurnPoses({errors.angle_deg[kTheta], errors.angle_deg[kPhi]}, &track);
  return track;
}

Places Predict(const CampaignModel& model, const CampaignFacts& facts,
               const ParallelFor& parallel) {
  const std::size_t rows = facts.campaign->rows();
  Places places{std::vector<double>(rows), std::vector<double>(rows)};
  const std::vector<UnitChunk> chunks = ChunksOf(model.units.size());
  parallel(chunks.size(), [&](std::size_t chunk) {
    PoseErrors errors;
    for (std::size_t unit = chunks[chunk].begin; unit < chunks[chunk].end; ++unit) {
      const UnitTrack track = TrackOf(model, facts, unit);
      errors.Reset(track.moves);
      AddPoseErrors(model, unit, track, &errors);
      CampaignUnit bent = model.units[unit];
      for (std::size_t i = 0; i < track.moves; ++i) {
        for (const std::size_t axis : {kTheta, kPhi})
          bent.arm_mm[axis] = model.units[unit].arm_mm[axis] + errors.arm_mm[axis][i];
        const PlacePoint place =
            PlaceOf(bent, track.cmd_deg[kTheta][i] + errors.angle_deg[kTheta][i],
                    track.cmd_deg[kPhi][i] + errors.angle_deg[kPhi][i]);
        const std::size_t row = track.first_row + i;
        places.x_mm[row] = place.x_mm + errors.x_mm[i];
        places.y_mm[row] = place.y_mm + errors.y_mm[i];
        double *x_mm = &places.x_mm[row], *y_mm = &places.y_mm[row];
        if (!model.exposures.empty())
          AddImage(model.exposures[facts.exposures.of_row[row]], place, x_mm, y_mm);
        if (model.frames.empty()) continue;
        const FrameTerm& frame = model.frames[facts.frames.of_row[row]];
        AddImage({frame[0], frame[1], frame[2], frame[3]}, place, x_mm, y_mm);
      }
    }
  });
  return places;
}

}  // namespace focalfleet::sim
