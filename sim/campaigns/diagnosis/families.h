// Families are causes whose signatures are near each other. Where the library has the true shape of
// a cause only roughly, the cause leaves a misfit artefact that looks like another cause of its
// family.
#pragma once

#include <string_view>
#include <vector>

#include "sim/campaigns/diagnosis/diagnosis.h"
#include "sim/campaigns/diagnosis/rotors.h"

namespace focalfleet::sim {

/// Whether the two causes have a family in common.
bool AreRelated(std::string_view a, std::string_view b);

/// Whether effects of the two axes can touch each other. The axes are names, and "both" and "none"
/// touch all.
bool AxesMeet(std::string_view a, std::string_view b);

/// Whether `misfit_artefact` may be left by the shape of `of`. No shape leaves more than half of
/// its effect, in the units where it leaves it.
bool CanLeave(const CauseFound& of, const CauseFound& misfit_artefact);

/// Adds to `of` the misfit of its shape, with its size and the name that it looks like: a cause or
/// a column.
void ReportAsMisfitArtefact(double size_um, std::string_view looks_like, CauseFound* of);

/// The cause whose shape leaves such a small structure; nullptr where the structure is worth
/// reporting. The cause is one of all units on the same axis, of ten times the structure's size.
/// For a structure of the image it may be moving air of four times its size. The structure also has
/// to be far below the noise: pooled over many rows the smallest one is significant. `noise_um`:
/// rms of the residuals.
CauseFound* CauseThatLeaves(const UnknownFound& left, double noise_um,
                            std::vector<CauseFound>* causes);

/// Reports the structure with the cause whose shape leaves it, where there is one
/// (CauseThatLeaves). Returns whether there is.
bool IsReportedAsMisfitArtefact(const UnknownFound& left, std::string_view looks_like,
                                double noise_um, std::vector<CauseFound>* causes);

/// Judges weak causes beside strong ones. A weak cause is uncertain where it may be a misfit of the
/// strong one's shape, in units that have both. Relatives on the same axis are such causes, and
/// causes that only units of the strong one have. They get the strong one as a candidate. A misfit
/// artefact is a faint cause, in ln L or beside a cause of an axis. Its size is less than that
/// one's shape can leave. The same holds for a cause that is hardly there beside a strong cause of
/// any axis. Pre: strongest first. `units`: of the campaign.
void JudgeMisfitArtefacts(std::size_t units, std::vector<CauseFound>* causes);

/// Removes names that half of the library could have. A weak misfit artefact of a strong cause
/// goes; any other becomes unknown. A broken tooth that many units have and none shows becomes
/// unknown, too. Pre: strongest first.
void JudgeNames(std::vector<CauseFound>* causes, std::vector<UnknownFound>* unknown);

/// Moves a cause into the unknown where it only names a part of an unknown structure. The cause
/// explains less than the structure, which is of the same axis or follows the cause's angle.
void JudgeBesideUnknown(std::vector<CauseFound>* causes, std::vector<UnknownFound>* unknown);

/// Judges three causes or more that depend on where one axis stands. They are a series of shapes
/// rather than causes: each gets the others as candidates, and the axis is reported as not
/// understood.
void JudgeSeries(std::vector<CauseFound>* causes, std::vector<UnknownFound>* unknown);

/// Judges causes of rotors that are turned far out of their field. There the effects of phases bend
/// like those of the rotor's poles. Each is then the other's candidate, unless it is left out of
/// the library. The model's gears decide which. The cause that exact waves have decided is final.
/// The weaker of the two causes, where it could be the stronger, is a misfit artefact of it.
void JudgeRotors(const CampaignModel& model, const std::vector<std::string>& left_out,
                 const RotorCauses& reported, std::vector<CauseFound>* causes);

/// Adds untested causes as candidates of the causes that they may pass for without the column that
/// is missing.
void JudgeUntested(const std::vector<NotTestable>& not_testable, std::vector<CauseFound>* causes);

}  // namespace focalfleet::sim
