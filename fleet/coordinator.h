// The coordinator is the one transition function of the fleet: Step(inputs) -> effects. Its state
// is the knowledge of every unit and bus, and the work under way with them. Clock, thread, file,
// socket and log are the shell's. The shell polls, calls Step, and performs the effects in this
// order:
//
//   rows      to the store:   one transaction a batch; Inputs::committed_through confirms it
//   frames    to the buses:   in their order
//   plan_job  to the planner: RunPlanJob on a thread of its own; PlanDone brings the answer
//   exposure  to the camera:  ExposureDone brings the answer
//   replies   to the senders of the commands
//   sync_at   to the SYNC line: an edge at this instant, where there is a line
//   changed   to DDS:         the newest value of each unit is enough
//
// Rows that a motion needs come first. A start signal is among the frames of a later step, when the
// batch with its intent is durable. Frames that stop a unit wait for nothing.
//
// A configuration is a goal, carried out in rounds: plan from the present places, stage, confirm by
// read-back, arm, commit the intent, start, watch. A unit that fails at any step is named and
// frozen, and the next round plans around it. Units held back to protect it go on then. The number
// of rounds is bounded. docs/way_of_a_move.md follows one move through here.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "fleet/coordinate/bus_view.h"
#include "fleet/coordinate/commands.h"
#include "fleet/coordinate/configuration_view.h"
#include "fleet/coordinate/coordinator_config.h"
#include "fleet/coordinate/effects.h"
#include "fleet/coordinate/inputs.h"
#include "fleet/coordinate/sector_round.h"
#include "fleet/coordinate/unit_view.h"
#include "fleet/layout.h"

namespace focalfleet {

struct Preview;

class Coordinator {
 public:
  /// `layout` outlives the coordinator.
  Coordinator(const Layout* layout, std::vector<UnitDrive> drives, CoordinatorConfig config,
              StoredFleet stored);
  ~Coordinator();

  /// Takes in what has come since the last step and appends to `effects` what is to be done. Each
  /// list of inputs is taken from its front, in this order: notes, refused rows, links, frames,
  /// plans, exposures, commands. Everything that is due at `now` follows. A command is therefore
  /// decided by the frames of the same step, and a stop ends what an answer has just begun. The
  /// same inputs in the same order give the same effects, to the bit. Pre: `now` is not before that
  /// of the last step; `effects` is clear; frames are of buses of the layout. Cost: as many units
  /// as are heard, commanded or due, and one pass over the units of a configuration. Allocations:
  /// none where units are asked, heard and polled alone, at rest or in motion, once the buffers
  /// have grown and where `effects` is reused. A step allocates for rows with text (alarms,
  /// configurations), for replies and for jobs. The results of a plan or an exposure allocate, too,
  /// and so do units that the store had no row of.
  void Step(const Inputs& inputs, Effects* effects);
  /// Appends what must still be written when the shell ends. Units that move finish by themselves.
  void End(HostInstant now, Effects* effects);

  /// The job that plans what an `apply` would begin with, from the present places. Nothing changes;
  /// the shell has the job done and keeps its answer from Step. Errors: those of the command.
  [[nodiscard]] Result<Preview> PreviewOf(const ApplyCommand& command) const;

  [[nodiscard]] const UnitView& unit(PositionerIndex i) const;
  /// Knowledge for showing: as `unit(i).knowledge`, but a moving unit's is predicted at `now`, and
  /// a unit whose intent has not begun is where it was. The store has it anywhere on its way
  /// already.
  [[nodiscard]] UnitKnowledge KnowledgeAt(PositionerIndex i, HostInstant now) const;
  [[nodiscard]] const BusView& bus(BusId bus) const;
  [[nodiscard]] const ConfigurationView& configuration() const;
  [[nodiscard]] std::span<const UnitDrive> drives() const;
  [[nodiscard]] const CoordinatorConfig& config() const;
  /// How far a sector of a plane is with its round.
  [[nodiscard]] SectorView sector() const;
  [[nodiscard]] bool busy() const;  // a configuration or homing is under way

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace focalfleet
