// The lists of the store's history as the control socket reports them. docs/cli.md has the members.
#pragma once

#include <vector>

#include "daemon/control/messages.h"
#include "daemon/store/history.h"

namespace focalfleet {

Json HistoryJson(const std::vector<ConfigurationHistory>& configurations);
Json HistoryJson(const std::vector<MoveHistory>& moves);
Json HistoryJson(const std::vector<ParameterHistory>& parameters);
Json HistoryJson(const std::vector<TuningHistory>& tunings);
Json HistoryJson(const std::vector<AlarmHistory>& alarms);
Json HistoryJson(const std::vector<UnitHistory>& units);
Json HistoryJson(const std::vector<MeasurementHistory>& measurements);
Json HistoryJson(const std::vector<UnitMeasured>& measured);

}  // namespace focalfleet
