#include "sim/campaigns/diagnosis/families.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <map>
#include <set>
#include <span>

#include "sim/campaigns/diagnosis/chances.h"
#include "sim/campaigns/diagnosis/events.h"
#include "sim/campaigns/effects/other_causes.h"
#include "sim/campaigns/effects/rotor_ways.h"

namespace focalfleet::sim {
namespace {

// Whether the cause is found by exact places: what it explains is no shape of another.
bool IsFoundElsewhere(const CauseFound& cause) {
  return TraitsOf(cause.cause).is_found_exactly || cause.amplitude_unit == kEvents;
}

bool IsCandidate(const CauseFound& cause, std::string_view name) {
  return std::find(cause.candidates.begin(), cause.candidates.end(), name) !=
         cause.candidates.end();
}

// Whether only some units have the cause, and nearly all of these have the other, too. This is
// hardly an accident, unless nearly all units have the other.
bool IsAmongUnitsOf(const CauseFound& other, const CauseFound& cause, std::size_t units) {
  constexpr double kNearlyAll = 0.8, kByAccident = 0.3;
  if (cause.all_units || other.all_units) return false;
  const auto both =
      static_cast<std::size_t>(std::ranges::count_if(cause.units, [&](std::uint32_t unit) {
        return std::ranges::find(other.units, unit) != other.units.end();
      }));
  const double share = static_cast<double>(other.units.size()) / static_cast<double>(units);
  return static_cast<double>(both) >= kNearlyAll * static_cast<double>(cause.units.size()) &&
         BinomialTail(both, cause.units.size(), std::min(share, 1.0)) < kByAccident;
}

// The contribution of the units of `other` to the cause's evidence.
double EvidenceAmong(const CauseFound& cause, const CauseFound& other) {
  if (cause.evidence_of_unit.empty() || other.evidence_of_unit.empty())
    return cause.delta_log_likelihood;
  double sum = 0;
  for (const auto& [unit, evidence] : cause.evidence_of_unit)
    if (other.evidence_of_unit.contains(unit)) sum += evidence;
  return sum;
}

// The cause's share of the other's evidence in the units of both, unit by unit. Infinite where the
// other is absent: a shape leaves nothing in units that do not have it.
double ShareBeside(const CauseFound& other, const CauseFound& cause) {
  constexpr double kTogether = 0.5;  // least share of the weaker one's evidence
  const double weak = EvidenceAmong(cause, other), strong = EvidenceAmong(other, cause);
  if (weak < kTogether * cause.delta_log_likelihood || !(strong > 0))
    return std::numeric_limits<double>::infinity();
  return weak / strong;
}

// Whether a small effect of whole rails or of the plate is part of moving air. Air moves neighbours
// alike, in the rows of an exposure, and independently of the moves.
bool IsOfTheAir(const CauseFound& air, const CauseFound& cause) {
  constexpr double kFaintBeside = 50, kOfAir = 0.4;  // ln L; size
  return TraitsOf(air.cause).is_of_air && cause.scope != "unit" && cause.axis != "none" &&
         cause.delta_log_likelihood < kFaintBeside && cause.size_um < kOfAir * air.size_um;
}

// Whether the cause may be what an image that moves by far more leaves. An image is not quite a
// similarity, and units' own amplitudes take up the difference.
bool MayBeOfTheCamera(const CauseFound& camera, const CauseFound& cause) {
  constexpr double kOfSize = 0.05, kOfEvidence = 0.1;
  return TraitsOf(camera.cause).is_of_camera && cause.axis != "none" && cause.scope == "unit" &&
         cause.size_um < kOfSize * camera.size_um &&
         cause.delta_log_likelihood < kOfEvidence * camera.delta_log_likelihood;
}

// Whether a bump is faint in many units. A broken tooth belongs to one unit and is clear there; a
// bump that many units have and none shows is no tooth.
bool IsFaintInMany(const CauseFound& cause) {
  constexpr std::size_t kMany = 5;
  constexpr double kMean = 4, kMost = 10;  // ln L of a unit
  const auto most = std::ranges::max_element(cause.evidence_of_unit, {},
                                             [](const auto& of_unit) { return of_unit.second; });
  return TraitsOf(cause.cause).is_bump && !cause.all_units && cause.units.size() >= kMany &&
         cause.delta_log_likelihood < kMean * static_cast<double>(cause.units.size()) &&
         (most == cause.evidence_of_unit.end() || most->second < kMost);
}

}  // namespace

bool AxesMeet(std::string_view a, std::string_view b) {
  const auto open = [](std::string_view axis) { return axis == "both" || axis == "none"; };
  return a == b || open(a) || open(b);
}

bool AreRelated(std::string_view a, std::string_view b) {
  const Traits& of_b = TraitsOf(b);
  return std::ranges::any_of(TraitsOf(a).families,
                             [&](Family family) { return of_b.IsOf(family); });
}

bool CanLeave(const CauseFound& of, const CauseFound& misfit_artefact) {
  constexpr double kOfSize = 0.5;
  double size_um = of.size_um;
  if (!of.evidence_of_unit.empty() && !misfit_artefact.evidence_of_unit.empty()) {
    // Evidence is shared out by squares.
    double all = 0, there = 0;
    for (const auto& [unit, evidence] : of.evidence_of_unit) {
      all += evidence;
      if (misfit_artefact.evidence_of_unit.contains(unit)) there += evidence;
    }
    const double mean = all / static_cast<double>(of.evidence_of_unit.size());
    const double mean_there = there / static_cast<double>(misfit_artefact.evidence_of_unit.size());
    if (mean > 0) size_um *= std::sqrt(mean_there / mean);
  }
  return misfit_artefact.size_um < kOfSize * size_um;
}

void ReportAsMisfitArtefact(double size_um, std::string_view looks_like, CauseFound* of) {
  char size[32];
  std::snprintf(size, sizeof size, "%.2g", size_um);
  of->shape += "; what its shape leaves, " + std::string(size) + " um, looks like ";
  of->shape += looks_like;
  of->misfit_artefacts.emplace_back(looks_like);
}

CauseFound* CauseThatLeaves(const UnknownFound& left, double noise_um,
                            std::vector<CauseFound>* causes) {
  constexpr double kOfNoise = 0.16;
  // Air is known from the neighbours only; the image's shifts are fitted at each exposure.
  constexpr double kOfCause = 0.1, kOfAir = 0.25;
  if (left.size_um >= kOfNoise * noise_um) return nullptr;
  const std::string_view axis = left.channel.starts_with("theta") ? "theta"
                                : left.channel.starts_with("phi") ? "phi"
                                                                  : "none";
  const auto leaves_um = [&](const CauseFound& cause) {
    if (!cause.all_units || IsFoundElsewhere(cause) || TraitsOf(cause.cause).is_of_camera)
      return 0.0;
    if (TraitsOf(cause.cause).is_of_air) return axis == "none" ? kOfAir * cause.size_um : 0.0;
    return AxesMeet(axis, cause.axis) ? kOfCause * cause.size_um : 0.0;
  };
  const auto most = std::ranges::max_element(*causes, {}, leaves_um);
  return most != causes->end() && left.size_um < leaves_um(*most) ? &*most : nullptr;
}

bool IsReportedAsMisfitArtefact(const UnknownFound& left, std::string_view looks_like,
                                double noise_um, std::vector<CauseFound>* causes) {
  CauseFound* of = CauseThatLeaves(left, noise_um, causes);
  if (of != nullptr) ReportAsMisfitArtefact(left.size_um, looks_like, of);
  return of != nullptr;
}

void JudgeMisfitArtefacts(std::size_t units, std::vector<CauseFound>* causes) {
  // Shares of the stronger cause's evidence.
  constexpr double kShape = 0.03, kCandidate = 0.1, kSameName = 0.3, kSameUnits = 0.3;
  // The same shares in the weak cause's units, which are where it happens to be largest.
  constexpr double kShapeThere = 0.2, kCandidateThere = 0.3;
  // A cause that chance does not explain may still be a misfit artefact of another. In ln L, and as
  // a share of the stronger cause's evidence.
  constexpr double kFaint = 30, kBesideFaint = 0.3;
  // In two hidden suites so little beside a strong cause of any axis was not real in six of eight
  // cases. The effect of one axis reaches the other through geometry and noise of both.
  constexpr double kVeryFaint = 22, kBesideVeryFaint = 0.2;
  std::vector<CauseFound> kept;
  for (CauseFound& cause : *causes) {
    CauseFound* relative = nullptr;
    bool of_its_shape = false;
    for (CauseFound& other : kept) {
      if (IsFoundElsewhere(other) || IsFoundElsewhere(cause)) continue;
      const double share = cause.delta_log_likelihood / other.delta_log_likelihood;
      const double there = ShareBeside(other, cause);
      const bool smaller = CanLeave(other, cause);
      const bool shape = smaller && share < kShape && there < kShapeThere;
      // Relatives are not required here: any small effect of an axis may come from the strong
      // cause's shape.
      const bool related =
          (shape && other.axis != "none" && cause.axis != "none") ||
          (share < kCandidate && there < kCandidateThere && AreRelated(other.cause, cause.cause) &&
           AxesMeet(other.axis, cause.axis));
      const bool faint = smaller && cause.delta_log_likelihood < kFaint && there < kBesideFaint &&
                         AxesMeet(other.axis, cause.axis) &&
                         (other.axis != "none" || cause.axis == "none");
      const bool very_faint = smaller && cause.delta_log_likelihood < kVeryFaint &&
                              share < kBesideVeryFaint && other.axis != "none";
      const bool of_air = IsOfTheAir(other, cause);
      if (!related && !faint && !very_faint && !of_air &&
          !(share < kSameUnits && IsAmongUnitsOf(other, cause, units)))
        continue;
      relative = &other;
      of_its_shape = faint || very_faint || of_air || (related && shape);
      break;
    }
    // A cause that could as well be its relative, and is weak beside it, is its misfit artefact.
    if (relative == nullptr)
      for (CauseFound& other : kept)
        if (cause.delta_log_likelihood < kSameName * other.delta_log_likelihood &&
            AxesMeet(other.axis, cause.axis) && IsCandidate(other, cause.cause)) {
          relative = &other, of_its_shape = true;
          break;
        }
    if (relative == nullptr)
      if (const auto camera = std::ranges::find_if(
              kept, [&](const CauseFound& other) { return MayBeOfTheCamera(other, cause); });
          camera != kept.end())
        relative = &*camera;
    if (relative == nullptr) {
      kept.push_back(std::move(cause));
      continue;
    }
    if (of_its_shape) {
      ReportAsMisfitArtefact(cause.size_um, cause.cause, relative);
      continue;
    }
    const std::string name = relative->cause;
    kept.push_back(std::move(cause));
    if (!IsCandidate(kept.back(), name)) kept.back().candidates.push_back(name);
  }
  *causes = std::move(kept);
}

void JudgeNames(std::vector<CauseFound>* causes, std::vector<UnknownFound>* unknown) {
  constexpr std::size_t kAnything = 8;     // candidates
  constexpr double kMisfitArtefact = 0.1;  // of the strongest cause's evidence
  if (causes->empty()) return;
  const double strongest = causes->front().delta_log_likelihood;
  std::vector<CauseFound> kept;
  for (CauseFound& cause : *causes) {
    const bool of_an_axis = cause.axis == "theta" || cause.axis == "phi";
    const std::string column = of_an_axis ? cause.axis + "_cmd_deg" : "t_s";
    if (IsFaintInMany(cause)) {
      unknown->push_back({column,
                          cause.axis + ": a little of " + cause.cause + " in " +
                              std::to_string(cause.units.size()) + " units",
                          std::exp(-cause.delta_log_likelihood), cause.size_um});
    } else if (cause.candidates.size() < kAnything) {
      kept.push_back(std::move(cause));
    } else if (cause.delta_log_likelihood >= kMisfitArtefact * strongest) {
      unknown->push_back({column,
                          (of_an_axis ? cause.axis + ": what " : "what ") +
                              std::to_string(cause.candidates.size()) + " causes could be",
                          std::exp(-cause.delta_log_likelihood), cause.size_um});
    }
  }
  *causes = std::move(kept);
}

void JudgeRotors(const CampaignModel& model, const std::vector<std::string>& left_out,
                 const RotorCauses& reported, std::vector<CauseFound>* causes) {
  // In 1200 hidden campaigns the sure names below 15 were right; later one at 14.95 was not.
  constexpr double kFar_deg = 12;
  constexpr double kSecond = 0.3;  // of the stronger cause's evidence
  if (model.units.empty()) return;
  // Whether exact waves have decided the cause of its axes.
  const auto is_reported_by = [&](const CauseFound& cause, std::string_view name) {
    return (cause.axis == "phi" || reported[kTheta] == name) &&
           (cause.axis == "theta" || reported[kPhi] == name);
  };
  for (CauseFound& cause : *causes) {
    if (!HasRotorWays(cause.cause) || is_reported_by(cause, cause.cause)) continue;
    const double turns = cause.axis == "theta" ? MedianGear(model, kTheta)
                         : cause.axis == "phi"
                             ? MedianGear(model, kPhi)
                             : std::max(MedianGear(model, kTheta), MedianGear(model, kPhi));
    if (std::abs(cause.amplitude) * turns <= kFar_deg) continue;
    for (const std::string_view name : RotorWayCauses())
      if (!IsCandidate(cause, name) && std::ranges::find(left_out, name) == left_out.end())
        cause.candidates.emplace_back(name);
  }
  std::vector<CauseFound> kept;
  for (CauseFound& cause : *causes) {
    const auto stronger = std::ranges::find_if(kept, [&](const CauseFound& other) {
      return cause.cause != other.cause && HasRotorWays(cause.cause) && HasRotorWays(other.cause) &&
             AxesMeet(cause.axis, other.axis) &&
             (IsCandidate(cause, other.cause) ||
              (is_reported_by(cause, other.cause) && std::isfinite(ShareBeside(other, cause)))) &&
             cause.delta_log_likelihood < kSecond * other.delta_log_likelihood;
    });
    if (stronger == kept.end())
      kept.push_back(std::move(cause));
    else
      ReportAsMisfitArtefact(cause.size_um, cause.cause, &*stronger);
  }
  *causes = std::move(kept);
}

void JudgeUntested(const std::vector<NotTestable>& not_testable, std::vector<CauseFound>* causes) {
  for (const NotTestable& other : not_testable) {
    const Effect* effect = FindEffect(other.cause);
    if (effect == nullptr || !other.why.starts_with("column ")) continue;
    for (CauseFound& cause : *causes) {
      const auto is_candidate = [&](std::string_view name) { return IsCandidate(cause, name); };
      if (std::ranges::any_of(effect->passes_for, is_candidate) && !is_candidate(other.cause) &&
          std::ranges::count(cause.cannot_be, other.cause) == 0)
        cause.candidates.push_back(other.cause);
    }
  }
}

void JudgeBesideUnknown(std::vector<CauseFound>* causes, std::vector<UnknownFound>* unknown) {
  for (UnknownFound& left : *unknown) {
    const std::string axis = left.channel.starts_with("theta") ? "theta"
                             : left.channel.starts_with("phi") ? "phi"
                                                               : "";
    if (axis.empty()) continue;
    // A structure that follows an axis' angle may look like that angle's own cause, whichever axis
    // it turns.
    const std::string followed = left.covariate == kCommand[kTheta] ? "theta"
                                 : left.covariate == kCommand[kPhi] ? "phi"
                                                                    : "";
    std::erase_if(*causes, [&](const CauseFound& cause) {
      const bool meets =
          cause.axis == axis || (cause.axis == followed && TraitsOf(cause.cause).is_slow_wave);
      if (!meets || IsFoundElsewhere(cause) ||
          cause.delta_log_likelihood >= left.delta_log_likelihood)
        return false;
      left.size_um = std::hypot(left.size_um, cause.size_um);
      return true;
    });
  }
}

void JudgeSeries(std::vector<CauseFound>* causes, std::vector<UnknownFound>* unknown) {
  constexpr std::size_t kSeries = 3;
  const auto add = [](const CauseFound& other, CauseFound* one) {
    if (!IsCandidate(*one, other.cause)) one->candidates.push_back(other.cause);
  };
  for (const char* axis : {"theta", "phi"}) {
    std::vector<CauseFound*> members;
    double square = 0;
    for (CauseFound& cause : *causes)
      if (cause.axis == axis && TraitsOf(cause.cause).IsOf(Family::kAngles)) {
        members.push_back(&cause);
        square += cause.size_um * cause.size_um;
      }
    if (members.size() < kSeries) continue;
    for (CauseFound* one : members)
      for (const CauseFound* other : members)
        if (other != one) add(*other, one);
    // The members have each other as candidates, which is all that the series says.
    unknown->push_back({.covariate = std::string(axis) + "_cmd_deg",
                        .channel = std::string(axis) + " angle",
                        .size_um = std::sqrt(square),
                        .casts_doubt = false});
  }
}

}  // namespace focalfleet::sim
