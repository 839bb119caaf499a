// Candidate shapes suit the data. A template that comes near the best is refined to its own best
// shape between the listed ones before any decision. Some shapes are each unit's own, as a damaged
// tooth is elsewhere in each gear. There each unit gets the shape that its residuals favour, and
// pays for the choice (evidence.h).
#pragma once

#include <span>
#include <vector>

#include "sim/campaigns/diagnosis/score/evidence.h"

namespace focalfleet::sim {

/// A template whose shape is being refined.
struct CandidateShape {
  Template form;
  double gap = 0;  // to the shapes that are tried beside it; 0: none are
};

/// The best templates of the causes that come near the best of all, `best`: an index, or kNoTerm.
/// Shapes: pass and evidence_of (templates). `kept_min`: share of a signature that must be left of
/// it beside geometry and model.
std::vector<CandidateShape> CandidateShapesOf(const ScorePass& pass,
                                              const std::vector<Evidence>& evidence_of,
                                              const Templates& templates, std::size_t best,
                                              double kept_min);

/// The effects that have own shapes, one for each axis, memory and form, with the best of the
/// listed shapes for each unit. Those are returned whose evidence, with each unit's choice paid
/// for, is more than `evidence_min`.
std::vector<CandidateShape> OwnShapes(const ScorePass& pass, const Templates& templates,
                                      const CampaignFacts& facts, const FleetGroups& groups,
                                      double evidence_min);

/// The templates of the library that differ from `form` in their shapes alone.
Templates KindOf(const Template& form, const Templates& library);

/// Refines each candidate shape to the shape between the listed ones that the data favour.
void RefineCandidateShapes(const Fit& fit, const FleetGroups& groups,
                           std::vector<CandidateShape>* candidate_shapes);

}  // namespace focalfleet::sim
