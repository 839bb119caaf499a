// Causes whose signatures are near each other, so that the true shape of one, where the library has
// it only roughly, leaves a misfit artefact that looks like another.
#pragma once

#include <string_view>
#include <vector>

#include "sim/campaigns/diagnosis/diagnosis.h"
#include "sim/campaigns/diagnosis/rotors.h"

namespace focalfleet::sim {

/// Have the two causes a family in common?
bool AreRelated(std::string_view a, std::string_view b);

/// Does it depend on where an axis stands?
bool IsOfAngle(std::string_view cause);

/// Does it drift as a night goes on?
bool IsOfNight(std::string_view cause);

/// Can what is of one axis touch what is of the other? By name: "both" and "none" touch all.
bool AxesMeet(std::string_view a, std::string_view b);

/// No shape leaves more than half of what it is, in the units where it leaves it.
bool CanLeave(const CauseFound& of, const CauseFound& misfit_artefact);

/// Tells what the shape of `of` leaves and what that looks like, by name: a cause or a column.
void ReportAsMisfitArtefact(double size_um, std::string_view looks_like, CauseFound* of);

/// Whose shape leaves so little structure: a cause of all units on the same axis, ten times its
/// size, or of the image the air, four times, where it is also far below the noise; pooled over
/// many rows the least is significant. `noise_um`: rms of the residuals. nullptr: nobody's, it is
/// worth telling.
CauseFound* CauseThatLeaves(const UnknownFound& left, double noise_um,
                            std::vector<CauseFound>* causes);

/// Reports the structure with the cause whose shape leaves it, where there is one
/// (CauseThatLeaves). Returns whether there is.
bool IsReportedAsMisfitArtefact(const UnknownFound& left, std::string_view looks_like,
                                double noise_um, std::vector<CauseFound>* causes);

/// A weak cause beside a strong one is no cause of its own for sure where it may be what the strong
/// one's shape leaves, in units that have both: a relative on the same axis, what only units of the
/// strong one have. It gets the strong one as a candidate. What is faint, in ln L or beside a cause
/// of an axis, and less than that one's shape can leave is told so, and what is hardly there beside
/// a strong cause of any axis. Pre: strongest first. `units`: of the campaign.
void JudgeMisfitArtefacts(std::size_t units, std::vector<CauseFound>* causes);

/// Single units that a cause moves by far more than noise, and whose rows it leaves nearly as far
/// off, do what no cause does: they are outliers.
void JudgeStrays(const Fit& fit, std::vector<CauseFound>* causes, OutliersFound* outliers);

/// A unit that would need three causes of its own or more behaves like none of them: it is named as
/// a unit, among the outliers, and what it does is unknown.
void JudgeUnits(std::size_t units, std::vector<CauseFound>* causes, OutliersFound* outliers,
                std::vector<UnknownFound>* unknown);

/// What half of the library could be is no name: a weak misfit artefact of a strong cause goes,
/// anything else is unknown. So is a broken tooth that many units have and none shows. Pre:
/// strongest first.
void JudgeNames(std::vector<CauseFound>* causes, std::vector<UnknownFound>* unknown);

/// On an axis with something unknown, or of the angle that this follows, a cause that explains less
/// than what is left is a name for a part of it: it goes into the unknown.
void JudgeBesideUnknown(std::vector<CauseFound>* causes, std::vector<UnknownFound>* unknown);

/// Three causes or more that depend on where one axis stands are a series of shapes rather than
/// causes: each gets the others as candidates, and the axis is told as not understood.
void JudgeSeries(std::vector<CauseFound>* causes, std::vector<UnknownFound>* unknown);

/// Where the rotor is turned far out of its field, what phases do bends as what the rotor's poles
/// do: each is the other's candidate, unless it is left out of the library. By the model's gears.
/// Where exact waves have told whose they are, it is that one's. Beside the stronger of the two the
/// other, where it could be it, is what its shape leaves.
void JudgeRotors(const CampaignModel& model, const std::vector<std::string>& left_out,
                 const RotorCauses& reported, std::vector<CauseFound>* causes);

/// Where the column is missing that would tell two causes apart, who could not be tested is a
/// candidate, too.
void JudgeUntested(const std::vector<NotTestable>& not_testable, std::vector<CauseFound>* causes);

}  // namespace focalfleet::sim
