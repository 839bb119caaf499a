// The verdict on a campaign names what the simulation gets wrong. docs/diagnosis.md has the fields
// as programs read them. Everything is a function of the campaign and the options alone: the same
// data give the same verdict, at any number of threads.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "sim/campaigns/campaign/place_steps.h"
#include "sim/campaigns/diagnosis/design/ahead.h"
#include "sim/campaigns/diagnosis/model/model.h"
#include "sim/campaigns/diagnosis/use/axis_classes.h"
#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {

struct CauseFound {
  std::string cause;
  std::vector<std::string> candidates;  // the cause itself first
  // Names that these data exclude, whatever else may be unexplained.
  std::vector<std::string> cannot_be;
  std::string axis;
  std::string scope;
  std::vector<std::uint32_t> units;
  bool all_units = false;
  double amplitude = 0;
  std::string amplitude_unit;
  double ci95[2] = {0, 0};
  bool at_bound = false;   // an amplitude is as large as physics allows
  double bound_share = 0;  // share of the amplitudes that are
  // Log odds of candidates against the cause, 0 where the data say nothing of it.
  std::map<std::string, double> log_odds;
  double doubt = 0;    // probability that none of the names is the cause
  double size_um = 0;  // rms at the fibre
  double delta_log_likelihood = 0;
  double predicted_gain_um = 0;
  std::string shape;      // of the template, in words
  std::string paragraph;  // for the operator
};

/// A cause by its name, which is its only candidate so far.
inline CauseFound CauseNamed(std::string_view name) {
  return {.cause = std::string(name), .candidates = {std::string(name)}};
}

/// An empirical term that the model has for what no cause explains (patch.h).
struct Patched {
  std::string term;    // "empirical_curve" or "empirical_ripple"
  double size_um = 0;  // rms at the fibre
};

struct UnknownFound {
  std::string covariate;
  std::string channel;  // where it shows: "theta angle", "x" ...
  double p_value = 0;
  double size_um = 0;
  double delta_log_likelihood = 0;  // of the structure, as if it were a cause
  std::optional<Patched> patched = std::nullopt;
  bool casts_doubt = true;  // on names beside it: they may be parts of it
};

struct OutliersFound {
  std::size_t rows = 0;
  std::vector<std::uint32_t> units;
  std::map<std::string, std::size_t> why;  // rows by reason
};

/// Figures on held-out moves. NaN where one is not known, as where nothing could be held out.
struct HeldOutGain {
  static constexpr double kNotKnown = std::numeric_limits<double>::quiet_NaN();
  double rms_before_um = kNotKnown, rms_after_um = kNotKnown;
  double mad_before_um = kNotKnown, mad_after_um = kNotKnown;
  double noise_floor_um = kNotKnown;
  double explained_share = kNotKnown;
  std::string held_out;
};

/// The separation of a cause and its rival by the proposed moves, as a chi-square (next_moves.h).
struct Prospect {
  std::string cause, rival;
  double d = 0;
};

/// The moves to make next, and the separations that they achieve.
struct NextMoves {
  std::vector<ProposedMove> moves;
  std::vector<Prospect> prospects;
  // Cause and rival that no moves separate.
  std::vector<std::pair<std::string, std::string>> inseparable;
};

enum class Verdict { kConsistent, kExplained, kAmbiguous, kUnknown, kInsufficient };
std::string_view Name(Verdict verdict);

struct Diagnosis {
  Verdict verdict = Verdict::kInsufficient;
  std::string insufficient;  // the reason, where the verdict is kInsufficient
  std::vector<CauseFound> causes;
  std::vector<UnknownFound> unknown;
  std::vector<NotTestable> not_testable;
  OutliersFound outliers;
  HeldOutGain gain;
  std::size_t rows = 0, units = 0, moves = 0;
  PlaceSteps steps;
  bool steps_limit = false;          // the steps are wider than the noise
  std::vector<AxisReport> axes;      // what each axis of each unit is like
  std::vector<std::string> remarks;  // on what is odd in the data (remarks.h)
  CampaignModel model;               // the extended model
  // Ids of units whose fit could not be a unit as the table describes it. The model has the table's
  // geometry for them, and no effects.
  std::vector<std::uint32_t> without_geometry;
  NextMoves next;
  // Residuals in um, for pictures. Shape: (rows); NaN where nothing was measured.
  std::vector<double> x_before_um, y_before_um, x_after_um, y_after_um;
};

struct DiagnoseOptions {
  std::uint64_t seed = 1;
  double family_wise = 0.01;
  // Templates of the model point into the library, which has to outlive the diagnosis.
  std::span<const Effect> library = EffectLibrary();
  std::vector<std::string> leave_out;     // causes to leave out of the library
  std::uint64_t shuffle_library = 0;      // not 0: seed of another order of its templates
  const CampaignModel* before = nullptr;  // an extended model to start from; else the nominal one
  bool patch = false;                     // add empirical terms for what is unknown
  bool with_gain = true;
  bool with_next_moves = true;
  ParallelFor parallel = OneAfterTheOther();
  std::function<void(double share, std::string_view stage)> progress = [](double,
                                                                          std::string_view) {};
};

/// The verdict on a campaign. Pre: Validate(campaign).
Diagnosis Diagnose(const Campaign& campaign, const DiagnoseOptions& options);

}  // namespace focalfleet::sim
