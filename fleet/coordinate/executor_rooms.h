// The rooms of the configuration executor, each with the data that it owns. A room knows those
// above it in this list, never those below, and nothing of the sequence in which the executor uses
// them.
#pragma once

#include "fleet/coordinate/configuration.h"
#include "fleet/coordinate/configuration_measurement.h"
#include "fleet/coordinate/coordination.h"
#include "fleet/coordinate/corrections.h"
#include "fleet/coordinate/homing.h"
#include "fleet/coordinate/late_moves.h"
#include "fleet/coordinate/round.h"
#include "fleet/coordinate/round_start.h"
#include "fleet/coordinate/upload.h"

namespace focalfleet {

struct ExecutorRooms {
  explicit ExecutorRooms(const Coordination& coordination)
      : fleet(coordination),
        configuration(fleet),
        round(fleet.units.size()),
        upload(fleet, &round),
        start(fleet, &round),
        corrections(fleet, &configuration),
        measurement(fleet, &configuration),
        homing(fleet, &configuration, &round),
        late(fleet, &configuration, &round, &upload) {}
  ExecutorRooms(const ExecutorRooms&) = delete;
  ExecutorRooms& operator=(const ExecutorRooms&) = delete;

  const Coordination fleet;
  Configuration configuration;
  Round round;
  Upload upload;
  RoundStart start;
  Corrections corrections;
  ConfigurationMeasurement measurement;
  Homing homing;
  LateMoves late;
};

}  // namespace focalfleet
