// The extended model of a campaign has the fitted static geometry of each unit and the accepted
// effects with their amplitudes. The model is the simulation with its effects, and predicts the
// place of every fibre after every move.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "sim/campaigns/campaign/campaign.h"
#include "sim/campaigns/effects/effect.h"

namespace focalfleet::sim {

/// Runs work(0) .. work(chunks - 1), in any order and on any threads. Each chunk by itself is
/// deterministic, and results are merged in the order of the chunks.
using ParallelFor =
    std::function<void(std::size_t chunks, const std::function<void(std::size_t)>& work)>;
ParallelFor OneAfterTheOther();

/// The level at which the amplitudes are the same.
enum class Sharing { kUnit, kRail, kBus, kFleet };
std::string_view Name(Sharing sharing);

inline constexpr std::uint32_t kNoGroup = UINT32_MAX;

/// An effect in the model. Units that do not have it are in no group.
struct ModelTerm {
  Template form;
  Sharing sharing = Sharing::kFleet;
  std::vector<std::uint32_t> group_of_unit;  // Shape: (units); groups are 0 .. groups - 1
  std::vector<double> amplitude;             // Shape: (groups, columns), flat
  std::vector<double> sigma;                 // standard deviation of each amplitude
  double spread = 0;  // standard deviation of the units' amplitudes, a prior; 0: none
  // The units' amplitudes are spread about a mean that is fitted with them; else about 0.
  bool has_mean = false;
  double mean = 0, mean_sigma = 0;

  [[nodiscard]] std::size_t groups() const { return amplitude.size() / form.columns; }
  /// The unit's amplitudes, empty where it does not have the effect.
  [[nodiscard]] std::span<const double> AmplitudeOf(std::size_t unit) const;
};

/// The distortions that the shape of a term may have, beside the term itself. Each is the term's
/// own error times a factor about its mean over all errors. Its amplitude has a prior of the
/// effect's relative discrepancy.
struct Discrepancy {
  ModelTerm term;                       // as it was when the distortions were made
  std::size_t of = 0;                   // its place among the model's terms
  std::vector<Distortion> distortions;  // kOwn first, if it is there
  std::vector<double> mean;             // of each factor. Shape: (distortions)
  double size[6] = {};                  // rms error in each channel
  double spread = 0;                    // prior
  // Units' amplitudes have a common part, but for kOwn: a common part of that is the term itself.
  std::vector<double> common, common_sigma;  // Shape: (distortions from first_common on)
  std::vector<double> own, own_sigma;        // Shape: (units, distortions); empty: no own part

  [[nodiscard]] std::size_t first_common() const {
    return !distortions.empty() && distortions[0] == Distortion::kOwn ? 1 : 0;
  }
  /// The unit's amplitudes, with the common parts. Shape: (distortions).
  [[nodiscard]] std::vector<double> AmplitudeOf(std::size_t unit) const;
  [[nodiscard]] bool HasUnit(std::size_t unit) const {
    return !distortions.empty() && term.group_of_unit[unit] != kNoGroup;
  }
};

/// Adds the errors of the unit by all distortions (discrepancy.h).
void AddDiscrepancy(const UnitTrack& track, const Discrepancy& discrepancy, std::size_t unit,
                    PoseErrors* errors);

/// All amplitudes of a term as one number: their mean over groups by certainty, where it has a
/// sign, else their root mean square.
struct AmplitudeSummary {
  double value = 0;
  double sigma = 0;  // 0: not known
};
AmplitudeSummary Summarise(const ModelTerm& term);

/// Shift and turn of the whole image at one exposure. Frame: plate, about its centre.
struct ExposureTerm {
  double shift_x_um = 0;
  double shift_y_um = 0;
  double turn_urad = 0;
  double scale_ppm = 0;

  [[nodiscard]] bool moves() const {
    return shift_x_um != 0 || shift_y_um != 0 || turn_urad != 0 || scale_ppm != 0;
  }
};
/// The number of its members.
inline constexpr int kExposureParameters = 4;

/// The same of all exposures of one frame of the camera, against the first frame, as unknowns of
/// the fit in the order of ExposureTerm's members.
using FrameTerm = std::array<double, kExposureParameters>;
/// A frame may stand anywhere on a bench: the spread of its prior, half and twice of which say the
/// same as far as there are data. In um, um, urad and ppm.
inline constexpr FrameTerm kFrameSpread = {1e4, 1e4, 1e5, 1e5};
/// More frames than these are no unknowns of the fit, and are aligned by it in turns. A search
/// costs as much for a frame as for four terms: half and twice of it change its time.
inline constexpr std::size_t kFramesOfFitMax = 25;

/// A step of one axis at one move that stays until the unit is homed (or for that move alone).
struct EventTerm {
  std::size_t unit = 0;
  std::size_t row = 0;  // of the campaign
  std::size_t axis = kTheta;
  bool stays = true;
  double step_deg = 0;
};

struct CampaignModel {
  std::string name = "nominal";
  std::vector<CampaignUnit> units;  // with the fitted geometry
  // Errors are so large that poses are those predicted, not those commanded.
  bool large_errors = false;
  std::vector<ModelTerm> terms;
  // A fit's own: what the shapes of terms differ by. A model that is reported has none.
  std::vector<Discrepancy> discrepancies;
  std::vector<ExposureTerm> exposures;  // empty, or Shape: (exposures)
  // A fit's own, of one campaign's frames; that of the first is 0. Empty, or Shape: (frames).
  std::vector<FrameTerm> frames;
  std::vector<EventTerm> events;
  // Zeros that differ from homing to homing: the angle that is added, per row. Empty: none.
  std::vector<double> homing_zero_deg[2];
  double homing_spread_deg[2] = {0, 0};  // their standard deviation, a prior
};

/// The number of moves with events: a lost move has an event of each axis.
std::size_t MovesWithEvents(const CampaignModel& model);

/// An axis from one homing to the next.
struct Homing {
  std::size_t axis = kTheta;
  std::size_t begin = 0, end = 0;  // moves of the track
};
/// Homings whose zero the model leaves free: theta's, then phi's. Empty where zeros are the same
/// after each homing.
std::vector<Homing> FreeHomingsOf(const CampaignModel& model, const UnitTrack& track);
/// Sets `errors` to one degree on the axis while the homing lasts.
void ApplyHoming(const UnitTrack& track, const Homing& homing, PoseErrors* errors);

/// Sets `errors` to those of one parameter of a frame at 1. Returns whether the unit has rows in
/// it.
bool ApplyFrame(const UnitTrack& track, std::size_t frame, std::size_t parameter,
                PoseErrors* errors);

/// Adds the pose errors of one unit by all terms, events and homings of the model.
void AddPoseErrors(const CampaignModel& model, std::size_t unit, const UnitTrack& track,
                   PoseErrors* errors);

/// A cause that these data cannot test.
struct NotTestable {
  std::string cause;
  std::string why;
};

/// Takes out the terms that cannot predict this campaign: it lacks a column, or its units and moves
/// have no such part. Returns them with the reasons.
std::vector<NotTestable> LeaveOutUntestable(const CampaignFacts& facts, CampaignModel* model);

/// A unit's moves at the poses after its steps, and after all errors where these are large. A lost
/// command may be half a turn, and a place depends differently on the geometry there.
UnitTrack TrackOf(const CampaignModel& model, const CampaignFacts& facts, std::size_t unit);

/// The place of every fibre after every move, by the model.
Places Predict(const CampaignModel& model, const CampaignFacts& facts, const ParallelFor& parallel);

/// Chunks of units that depend on their number alone.
struct UnitChunk {
  std::size_t begin = 0;
  std::size_t end = 0;
};
std::vector<UnitChunk> ChunksOf(std::size_t units);

}  // namespace focalfleet::sim
