#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <numbers>
#include <numeric>
#include <optional>
#include <set>

#include "protocol/base/rng.h"
#include "sim/campaigns/diagnosis/check/fine_structure.h"
#include "sim/campaigns/diagnosis/check/gain.h"
#include "sim/campaigns/diagnosis/check/geometry_check.h"
#include "sim/campaigns/diagnosis/check/screen.h"
#include "sim/campaigns/diagnosis/check/shared_walk.h"
#include "sim/campaigns/diagnosis/decide/decide.h"
#include "sim/campaigns/diagnosis/decide/diagnosis.h"
#include "sim/campaigns/diagnosis/decide/name_causes.h"
#include "sim/campaigns/diagnosis/decide/remarks.h"
#include "sim/campaigns/diagnosis/design/next_moves.h"
#include "sim/campaigns/diagnosis/model/chances.h"
#include "sim/campaigns/diagnosis/model/discrepancy.h"
#include "sim/campaigns/diagnosis/model/one_frame.h"
#include "sim/campaigns/diagnosis/model/plain_geometry.h"
#include "sim/campaigns/diagnosis/search/beaten.h"
#include "sim/campaigns/diagnosis/search/find_model.h"
#include "sim/campaigns/diagnosis/search/rotors.h"
#include "sim/campaigns/diagnosis/terms/events.h"
#include "sim/campaigns/diagnosis/terms/exchanged.h"
#include "sim/campaigns/diagnosis/terms/outliers.h"
#include "sim/campaigns/diagnosis/terms/pushed_apart.h"
#include "sim/campaigns/diagnosis/terms/rotor_phases.h"
#include "sim/campaigns/diagnosis/terms/wrong_sensors.h"
#include "sim/campaigns/diagnosis/use/patch.h"
#include "sim/campaigns/effects/other_causes.h"

namespace focalfleet::sim {
namespace {

constexpr std::size_t kMovesMin = 8;  // seen moves of a unit
// Where more places are beyond the arms' reach, the geometry is another unit's.
constexpr double kBeyondReachMax = 0.5;  // of the rows
constexpr double kKeptOfTermMin = 0.03;

// Templates that the data can test; the reasons for the others go to `not_testable`.
Templates ListLibrary(const CampaignFacts& facts, const DiagnoseOptions& options,
                      std::vector<NotTestable>* not_testable) {
  Templates templates;
  for (const Effect& effect : options.library) {
    if (IsLeftOut(options, effect.cause)) continue;
    const std::string_view missing = MissingCovariate(effect, facts);
    if (!missing.empty()) {
      not_testable->push_back(
          {std::string(effect.cause), "column " + std::string(missing) + " is missing"});
      continue;
    }
    Templates made = ListTemplates(effect, facts);
    std::erase_if(made, [&](const Template& form) { return !Shows(facts, form); });
    if (made.empty())
      not_testable->push_back(
          {std::string(effect.cause), "these units or moves have no such part"});
    templates.insert(templates.end(), made.begin(), made.end());
  }
  if (options.shuffle_library != 0) {
    Rng rng = Rng::Stream(options.shuffle_library, "library");
    for (std::size_t k = templates.size(); k > 1; --k)
      std::swap(templates[k - 1], templates[rng.Below(k)]);
  }
  return templates;
}

// Finds causes of which no template has a signature of its own in these moves.
void FindNotExcited(const Templates& templates, const Selection& selection,
                    std::vector<NotTestable>* out) {
  std::map<std::string_view, double> best;
  for (std::size_t k = 0; k < templates.size(); ++k) {
    double& most = best[templates[k].effect->cause];
    most = std::max(most, selection.kept_share[k]);
  }
  for (const auto& [cause, most] : best)
    if (most < kKeptOfTermMin)
      out->push_back({std::string(cause), most > 0 ? "static geometry explains the same as well"
                                                   : "the moves never excite it"});
}

// Adds what the screen found to what is reported: each column once, but for each term that patches
// it.
void AddUnknown(std::vector<UnknownFound> seen, std::vector<UnknownFound>* reported) {
  for (UnknownFound& one : seen) {
    const auto of_column = [&](const UnknownFound& other) {
      return other.covariate == one.covariate && (!one.patched || !other.patched);
    };
    const auto same = std::find_if(reported->begin(), reported->end(), of_column);
    if (same == reported->end())
      reported->push_back(std::move(one));
    else if (one.patched)
      same->patched = std::move(one.patched);
  }
}

// Finds what is left that no cause explains; with `patch`, adds terms for it.
void LookAtRest(const DiagnoseOptions& options, Fit* fit, Diagnosis* diagnosis) {
  std::vector<UnknownFound> seen;
  if (options.patch) {
    seen = PatchStructures({.family_wise = options.family_wise, .seed = options.seed},
                           &diagnosis->unknown, fit);
  } else if (auto structure = FindStructure(*fit, options.family_wise, options.seed)) {
    seen.push_back(std::move(structure->reported));
  }
  AddUnknown(std::move(seen), &diagnosis->unknown);
  if (!diagnosis->unknown.empty()) return;
  if (auto walk = FindSharedWalk(*fit, options.family_wise, options.seed)) {
    diagnosis->unknown.push_back(std::move(*walk));
    return;
  }
  if (auto odd = FindOddExposures(*fit, options.family_wise)) {
    diagnosis->unknown.push_back(std::move(*odd));
    return;
  }
  if (auto fine = FindFineStructure(*fit, options.family_wise))
    diagnosis->unknown.push_back(std::move(*fine));
}

// Temperatures by the neighbours' sensors, where sensors are suspect; else nullptr.
std::unique_ptr<TrueTemperatures> TestSensors(const CampaignFacts& facts,
                                              const DiagnoseOptions& options,
                                              std::vector<NotTestable>* not_testable) {
  if (std::string why = WhyNoSensorIsTested(facts); !why.empty()) {
    not_testable->push_back({std::string(kSensorBias), std::move(why)});
    return nullptr;
  }
  return IsLeftOut(options, kSensorBias) ? nullptr : FindSuspectSensors(facts);
}

std::string WhyInsufficient(const CampaignFacts& facts, const std::vector<char>& aside) {
  const Campaign& campaign = *facts.campaign;
  std::size_t most = 0;
  bool moved = false;
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
    std::size_t seen = 0;
    for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row) {
      if (aside[row] == 0 && std::isfinite(campaign.x_mm[row])) ++seen;
      moved = moved || facts.step_deg[0][row] != 0 || facts.step_deg[1][row] != 0;
    }
    most = std::max(most, seen);
  }
  if (most < kMovesMin)
    return "no unit was seen after " + std::to_string(kMovesMin) + " moves or more (the most is " +
           std::to_string(most) + ")";
  if (!moved) return "no axis was moved";
  if (!facts.closed.empty() && facts.frames.size() > 1)
    return "the loop was closed in several frames of the camera: the angles where moves began are "
           "of different frames. Diagnose each frame by itself";
  return {};
}

// The share of the used rows whose places no pose of the unit reaches.
double ShareBeyondReach(const Fit& fit) {
  constexpr double kBeyond_mm = 1;  // more than any geometry is off by
  const Campaign& campaign = *fit.facts->campaign;
  double beyond = 0, rows = 0;
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
    const CampaignUnit& by = fit.model.units[unit];
    for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row) {
      if (!fit.Used(row)) continue;
      const double way_mm =
          std::hypot(campaign.x_mm[row] - by.base_x_mm, campaign.y_mm[row] - by.base_y_mm);
      rows += 1;
      beyond += way_mm > by.arm_mm[kTheta] + by.arm_mm[kPhi] + kBeyond_mm ? 1 : 0;
    }
  }
  return rows > 0 ? beyond / rows : 0;
}

// The part that the given model already explains is no misfit. Its effects are subtracted from the
// measured places, and its geometry replaces the table's. The coordinator has closed its loop by
// the geometry that it had. Returns the displacements that were subtracted.
Places TakeAway(const CampaignModel& model, const CampaignFacts& facts, const ParallelFor& parallel,
                Campaign* campaign) {
  campaign->coordinator_units = std::move(campaign->units);
  campaign->units = model.units;
  CampaignModel plain;
  plain.units = model.units;
  Places taken = Predict(model, facts, parallel);
  const Places without = Predict(plain, facts, parallel);
  for (std::size_t row = 0; row < campaign->rows(); ++row) {
    taken.x_mm[row] -= without.x_mm[row], taken.y_mm[row] -= without.y_mm[row];
    campaign->x_mm[row] -= taken.x_mm[row], campaign->y_mm[row] -= taken.y_mm[row];
  }
  return taken;
}

// The classes of axes by the places as measured, whatever a given model explains of them. An axis
// that turns by another share of its command is to be seen to even where the model has that share.
// Names that are exchanged keep the displacements of the unit that each was taken for.
std::vector<AxisReport> ClassifyAsMeasured(Campaign campaign, const Places& taken,
                                           const std::vector<CampaignUnit>& units) {
  for (std::size_t row = 0; row < taken.x_mm.size(); ++row)
    campaign.x_mm[row] += taken.x_mm[row], campaign.y_mm[row] += taken.y_mm[row];
  return ClassifyAxes(campaign, units);
}

// Names a contact of arms for these rows, which are far no more then.
void ReportContact(const Fit& fit, const std::vector<std::size_t>& rows,
                   std::vector<std::size_t>* far, std::vector<CauseFound>* causes) {
  CauseFound touch = TouchCause(fit, rows);
  const auto reported = std::ranges::find(*causes, kContact, &CauseFound::cause);
  if (reported != causes->end()) {
    AddUnits(touch, &*reported);
  } else {
    const auto weaker = std::ranges::find_if(*causes, [&](const CauseFound& cause) {
      return cause.delta_log_likelihood < touch.delta_log_likelihood;
    });
    causes->insert(weaker, std::move(touch));
  }
  const std::set<std::size_t> touched(rows.begin(), rows.end());
  std::erase_if(*far, [&](std::size_t row) { return touched.count(row) != 0; });
}

// Far rows are contacts of arms where neighbours were pushed apart, or where arms are nearest.
// Other clusters of them are unknown.
void ReportClusters(const Fit& fit, std::vector<std::size_t> far, const DiagnoseOptions& options,
                    Diagnosis* diagnosis) {
  const bool may_touch = !IsLeftOut(options, kContact);
  if (const auto pushed = FindPushedApart(fit, far, options.family_wise)) {
    if (may_touch)
      ReportContact(fit, pushed->rows, &far, &diagnosis->causes);
    else
      AddUnknown({{.covariate = std::string(kArmGap),
                   .channel = "neighbours pushed apart",
                   .p_value = std::exp(pushed->log_p),
                   .size_um = pushed->size_um,
                   .delta_log_likelihood = -pushed->log_p}},
                 &diagnosis->unknown);
  }
  auto cluster = FindCluster(fit, far, options.family_wise);
  if (cluster && !cluster->touched.empty() && may_touch) {
    ReportContact(fit, cluster->touched, &far, &diagnosis->causes);
    cluster = FindCluster(fit, far, options.family_wise);
  }
  if (cluster) AddUnknown({std::move(cluster->reported)}, &diagnosis->unknown);
}

HeldOutGain GainOf(const Fit& fit, const std::optional<Campaign>& as_named,
                   const DiagnoseOptions& options) {
  if (!as_named) return MeasureGain(fit);
  const CampaignFacts facts = MakeFacts(*as_named);
  CampaignModel geometry;
  geometry.units = as_named->units;
  const Fit misnamed = StartFit(facts, std::move(geometry), fit.aside, options.parallel);
  return MeasureGain(fit, &misnamed);
}

// Measures the gain on held-out moves, and proposes the moves to make next.
void ProposeNextMoves(const Fit& fit, const std::optional<Campaign>& as_named,
                      const DiagnoseOptions& options, Diagnosis* diagnosis) {
  if (options.with_gain) {
    options.progress(0.9, "held-out moves");
    diagnosis->gain = GainOf(fit, as_named, options);
  }
  if (options.with_next_moves) {
    options.progress(0.95, "moves to make next");
    diagnosis->next = ProposeMoves(fit, diagnosis->causes);
  }
}

void Remark(std::vector<std::string> remarks, Diagnosis* diagnosis) {
  for (std::string& remark : remarks) diagnosis->remarks.push_back(std::move(remark));
}

void DescribeRows(const RepeatedPlaces& repeated, const CampaignFacts& facts,
                  Diagnosis* diagnosis) {
  diagnosis->rows = facts.campaign->rows();
  diagnosis->units = facts.campaign->units.size();
  diagnosis->moves = facts.exposures.size();
  Remark(RemarksOnRepeats(repeated, facts.campaign->rows()), diagnosis);
  Remark(RemarksOnOrder(facts), diagnosis);
  diagnosis->steps = FindPlaceSteps(*facts.campaign);
}

// The steps of the places limit the diagnosis where they make more of the noise than all else does.
void RemarkOnNoise(const Fit& fit, Diagnosis* diagnosis) {
  const double of_steps_um = 1e3 * SpreadOfStep(diagnosis->steps.wider_mm());
  diagnosis->steps_limit = std::numbers::sqrt2 * of_steps_um > fit.noise.place_um;
  if (diagnosis->steps_limit) Remark({RemarkOnSteps(diagnosis->steps)}, diagnosis);
}

// The fit with amplitudes as they are without distortions, which take a part of them.
Fit WithPlainAmplitudes(const Fit& fit) {
  Fit plain = fit;
  LeaveOutDiscrepancies(&plain);
  StepFit(&plain);
  Fit named = fit;
  named.model.terms = std::move(plain.model.terms);
  return named;
}

// A unit's fit is no model of it where its rows show nothing of the unit, or belong to another. The
// model then has the table's geometry for it.
void LeaveOutImpossible(const Campaign& given, Diagnosis* diagnosis) {
  CampaignModel& model = diagnosis->model;
  for (std::size_t unit = 0; unit < model.units.size(); ++unit) {
    const auto is_known = [&](const ModelTerm& term) {
      return std::ranges::all_of(term.AmplitudeOf(unit), [](double a) { return std::isfinite(a); });
    };
    if (CheckGeometry(given.units[unit], model.units[unit]).passes() &&
        std::ranges::all_of(model.terms, is_known))
      continue;
    model.units[unit] = given.units[unit];
    for (ModelTerm& term : model.terms) term.group_of_unit[unit] = kNoGroup;
    diagnosis->without_geometry.push_back(given.units[unit].id);
  }
  if (!diagnosis->without_geometry.empty())
    Remark({"no geometry like that of units.csv puts unit " + FirstOf(diagnosis->without_geometry) +
            " where it was seen: the model leaves such units out"},
           diagnosis);
}

}  // namespace

std::string_view Name(Verdict verdict) {
  switch (verdict) {
    case Verdict::kConsistent:
      return "consistent";
    case Verdict::kExplained:
      return "explained";
    case Verdict::kAmbiguous:
      return "ambiguous";
    case Verdict::kUnknown:
      return "unknown";
    case Verdict::kInsufficient:
      break;
  }
  return "insufficient";
}

Diagnosis Diagnose(const Campaign& given, const DiagnoseOptions& options) {
  Campaign campaign = given;
  Diagnosis diagnosis;
  options.progress(0, "reading the moves");
  const RepeatedPlaces repeated = ForgetRepeatedPlaces(&campaign);
  campaign.units = FindCoordinatorsGeometry(campaign);
  const Places as_measured{campaign.x_mm, campaign.y_mm};
  BringIntoOneFrame(options.parallel, &campaign);
  CampaignFacts facts = MakeFacts(campaign);
  DescribeRows(repeated, facts, &diagnosis);
  std::vector<char> aside;
  diagnosis.outliers = FindBeforeFit(facts, repeated, &aside);
  diagnosis.axes = ClassifyAxes(campaign, campaign.units);
  CampaignModel before;
  Places taken;
  if (options.before != nullptr) {
    before = *options.before;
    diagnosis.not_testable = LeaveOutUntestable(facts, &before);
    taken = TakeAway(before, facts, options.parallel, &campaign);
  }
  diagnosis.model.units = campaign.units;
  diagnosis.insufficient = WhyInsufficient(facts, aside);
  if (!diagnosis.insufficient.empty()) return diagnosis;
  options.progress(0.02, "static geometry");
  std::optional<Campaign> as_named;  // under the table's names, where some of these are wrong
  diagnosis.causes = UndoExchanges(&campaign, &facts, &as_named);
  SetAside(RowsUnderAnothersName(facts), "at another unit's place", &aside, &diagnosis.outliers);
  Fit fit = StartFit(facts, diagnosis.model, aside, options.parallel);
  // Geometry and many frames are found in turn. Without a round 30 frames of two moves are named as
  // a cause; other numbers have not been measured.
  constexpr int kRoundsOfFrames = 2;
  for (int round = 0; facts.frames.size() > kFramesOfFitMax && round < kRoundsOfFrames; ++round) {
    AlignByModel(fit.model, facts, options.parallel, &campaign);
    fit = StartFit(facts, diagnosis.model, aside, options.parallel);
  }
  if (ShareBeyondReach(fit) > kBeyondReachMax) {
    diagnosis.insufficient =
        "the places do not belong to these units: half of them are more than 1 mm beyond the reach "
        "of their arms";
    return diagnosis;
  }
  if (facts.closed.empty()) diagnosis.axes = ClassifyAsMeasured(campaign, taken, fit.model.units);
  diagnosis.x_before_um = fit.x_um, diagnosis.y_before_um = fit.y_um;
  for (const std::size_t axis : {kTheta, kPhi})
    facts.rotor_phase_deg[axis] = FindRotorPhases(fit, axis);
  Templates templates = ListLibrary(facts, options, &diagnosis.not_testable);
  SelectionRule rule{.family_wise = options.family_wise, .seed = options.seed};
  double share = 0.1;
  rule.progress = [&](std::string_view stage) {
    share += (0.75 - share) * 0.15;
    options.progress(share, stage);
  };
  const std::unique_ptr<TrueTemperatures> truth =
      TestSensors(facts, options, &diagnosis.not_testable);
  // A column may be gone that only the wrong sensors made.
  if (truth != nullptr)
    std::erase_if(templates, [&](const Template& form) { return !IsOffered(form, truth->facts); });
  Selection selection = FindModel(templates, options, rule, truth.get(), &fit, &diagnosis);
  DropBeaten(options.family_wise, options.seed, &fit, &selection);
  SettleRotors(templates, rule, options.leave_out, &fit, &selection);
  FindNotExcited(templates, selection, &diagnosis.not_testable);
  NameCauses(WithPlainAmplitudes(fit), selection, options, &diagnosis);
  options.progress(0.85, "what is left");
  LookAtRest(options, &fit, &diagnosis);
  ReportClusters(fit, FindAfterFit(fit, &diagnosis.outliers), options, &diagnosis);
  Decide(&diagnosis);
  // The model that is reported predicts without distortions: its amplitudes are the best for that.
  LeaveOutDiscrepancies(&fit);
  StepFit(&fit);
  ProposeNextMoves(fit, as_named, options, &diagnosis);
  diagnosis.x_after_um = fit.x_um, diagnosis.y_after_um = fit.y_um;
  diagnosis.model = fit.model;
  diagnosis.model.frames.clear();  // the campaign's own
  diagnosis.model.terms.insert(diagnosis.model.terms.begin(), before.terms.begin(),
                               before.terms.end());
  Remark(
      RemarksOnFrames(facts.frames, Predict(diagnosis.model, facts, options.parallel), as_measured),
      &diagnosis);
  LeaveOutImpossible(given, &diagnosis);
  RemarkOnNoise(fit, &diagnosis);
  options.progress(1, "done");
  return diagnosis;
}

}  // namespace focalfleet::sim
