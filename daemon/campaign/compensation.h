// The compensation sends commands through the model of a campaign. A command is given in angles of
// the unit's own count, chosen so that its fibre comes to its target. The model predicts the place
// after a move from the count at its end, the direction that it comes from, and the effects added
// up since the campaign. The command is the inverse of the model (fleet/place_inverse.h).
//
// A unit's way since the campaign is kept here: where the campaign left it, and each place at which
// it came to rest. Motion during the daemon's absence (another daemon, a restart) counts as one
// straight move. A unit that was homed counts anew, and the model's zeros are no longer its own: it
// goes uncompensated until there is another model. Units that the campaign did not measure go
// uncompensated, too. Effects that need conditions unknown to the daemon (temperature, supply,
// elevation), and those of camera, rails and plate, are left out, by name.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/campaign/model_file.h"
#include "fleet/drive.h"
#include "fleet/kinematics.h"
#include "fleet/layout.h"
#include "protocol/base/result.h"
#include "sim/campaigns/effects/pose_track.h"

namespace focalfleet {

class Compensation {
 public:
  /// `model` was read for the units of `layout`.
  Compensation(const ModelFile& model, const Layout& layout);

  struct Wish {
    PointFp fibre_fp;                           // where the fibre is to end
    AxisAngles now;                             // count before the move
    AxisAngles guess;                           // count that leads there without the model
    std::array<double, kAxisCount> last_deg{};  // last piece of a unidirectional approach; 0: none
  };
  /// The count at the end of the move. None: the unit is not in the model, or the model does not
  /// lead there (farther than 30 degrees from the guess). Not held to the axes' ranges. Error:
  /// below 0.5 um by the model where the fibre can get there, else near the nearest point. Cost:
  /// some microseconds for each effect and iteration; at most 12 iterations.
  [[nodiscard]] std::optional<AxisAngles> CountFor(PositionerIndex i, const Wish& wish) const;

  /// A unit as the planner has it, in whole vectors.
  struct Stand {
    const Unit* unit = nullptr;
    const UnitDrive* drive = nullptr;
    Pose place{};
    Pose offset{};                              // place less count
    std::array<double, kAxisCount> last_deg{};  // as in a wish
  };
  /// The offset of place from count from now on, so that the way from the present place to the
  /// target is the way of the count. None: as CountFor.
  [[nodiscard]] std::optional<Pose> OffsetFor(PositionerIndex i, const Stand& stand,
                                              const Pose& target) const;

  /// Where the model has the fibre after a move from the unit's last rest to `count`.
  [[nodiscard]] std::optional<PointFp> FibreAfter(PositionerIndex i, const AxisAngles& count) const;

  /// The unit rests at this count.
  void Rests(PositionerIndex i, const AxisAngles& count);
  /// The serial number of the hardware that the campaign measured there; 0: the model does not say.
  [[nodiscard]] SerialNumber serial(PositionerIndex i) const {
    return units_[i.value] ? SerialNumber{units_[i.value]->geometry.serial} : SerialNumber{};
  }
  /// Commands to this unit go through the model.
  [[nodiscard]] bool Knows(PositionerIndex i) const { return units_[i.value].has_value(); }
  /// The unit goes without the model: its count began anew (homed, set by hand, found by the
  /// camera), or other hardware stands in its place.
  void Forget(PositionerIndex i) { units_[i.value].reset(); }

  /// Number of units whose commands go through the model.
  [[nodiscard]] std::size_t units() const;
  /// Causes in the model that are not compensated, once each.
  [[nodiscard]] const std::vector<std::string>& left_out() const { return left_out_; }

 private:
  using AxisPair = sim::PoseTrack::AxisPair;
  struct Term {
    sim::Template form;
    std::vector<double> amplitude;
  };
  struct KnownUnit {
    sim::CampaignUnit geometry;
    std::vector<Term> terms;
    AxisPair added_deg{};
    AxisPair begin_deg{};
    std::vector<AxisPair> rests_deg;
  };

  static sim::PoseTrack WayOf(const KnownUnit& unit);
  static PointFp PlaceAfter(const KnownUnit& unit, sim::PoseTrack* way, sim::PoseErrors* errors);
  static void Shorten(KnownUnit* unit);

  std::vector<std::optional<KnownUnit>> units_;  // by PositionerIndex
  std::vector<std::string> left_out_;
};

/// A model.toml that may be in force for a fleet.
struct ModelInForce {
  ModelFile file;
  Compensation compensation;
};
/// The model of a text. Errors: as ReadModelFile; kInvalid: its campaign was insufficient, or it
/// names for no unit of the layout where the campaign left it.
Result<ModelInForce> ReadModelInForce(std::string_view text, const std::string& file,
                                      const Layout& layout);

}  // namespace focalfleet
