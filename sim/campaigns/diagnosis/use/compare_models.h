// A comparison of two models says which predicts a campaign better, without any fit. Both are
// judged on the same rows, so that most of the noise is common to them and cancels in the
// difference.
// The rest of the noise is drawn anew with whole exposures (bootstrap), because fibres of one
// exposure have camera and conditions in common. The interval holds 95 % of the differences so
// drawn, and a model is better where zero lies outside. The comparison also lists how the two
// models differ, in terms and geometry.
// Source: Efron and Tibshirani, An Introduction to the Bootstrap, chapters 8 and 13.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "sim/campaigns/diagnosis/model/model.h"

namespace focalfleet::sim {

/// Two models of the same units in the same order.
struct ModelPair {
  const CampaignModel* a = nullptr;
  const CampaignModel* b = nullptr;
};

struct JudgedModel {
  double rms_um = 0;
  double mad_um = 0;                  // median length of the 2-D residual
  std::vector<NotTestable> left_out;  // terms that these data cannot test
};

enum class Preference { kNone, kA, kB };

inline constexpr std::size_t kExposuresForPreference = 8;  // fewer show no difference

struct ModelComparison {
  std::size_t rows = 0;  // judged
  std::size_t exposures = 0;
  std::map<std::string, std::size_t> left_out;  // rows that are not judged, by reason
  JudgedModel a, b;
  double difference_um = 0;  // rms of B less that of A
  double ci95_um[2] = {0, 0};
  Preference preference = Preference::kNone;
};

struct CompareOptions {
  std::uint64_t seed = 1;
  std::size_t resamples = 2000;
  ParallelFor parallel = OneAfterTheOther();
};

/// Compares the models on the rows that can be judged; rows == 0 where none can. The comparison
/// leaves out rows without a place, or with a repeated place. Rows of units that do not move or
/// stand elsewhere by both models are also left out, as are rows far off by both. Exchanging the
/// models changes the sign of the difference and nothing else.
/// Pre: Validate(campaign), whose units the models have.
ModelComparison CompareModels(const ModelPair& models, const Campaign& campaign,
                              const CompareOptions& options);

/// A term as one model has it.
struct TermSide {
  std::string shape;      // in words
  std::size_t units = 0;  // number of units that have it
  AmplitudeSummary amplitude;
};

/// A term of A, of B, or the same of both.
struct TermDifference {
  std::string cause;
  std::string axis;  // of an empirical term the channel
  std::string amplitude_unit;
  std::optional<TermSide> a, b;
  /// Standard deviations of one number that are as unlikely as all amplitudes' changes together.
  /// NaN where the term is not in both, has another shape, or has no standard deviations.
  double sigmas = 0;
};

struct GeometryDifference {
  std::string what;
  std::string unit;
  double rms = 0;  // over units
  double largest = 0;
  std::uint32_t largest_unit = 0;  // its id
};

struct ModelDifference {
  std::vector<TermDifference> terms;         // of A in its order, then those of B alone
  std::vector<GeometryDifference> geometry;  // zeros, bases, arms
};

ModelDifference DifferenceOf(const ModelPair& models);

}  // namespace focalfleet::sim
