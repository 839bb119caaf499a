// The measurement of a configuration: when all units rest, their own sensors are read and an
// exposure is asked for. Each finding is put into the unit's view, its place, and a row for the
// store. Where units of unknown place have targets, an exposure comes before any unit moves, too.
// The counts of such units are then set to where they are found (count_setting.h).
//
// A unit reports its own count, and a measured place replaces it. A correction is therefore a
// configuration like any other, from the true places; only the way to it is fixed (corrections.h).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "fleet/coordinate/configuration.h"
#include "fleet/coordinate/coordination.h"
#include "fleet/coordinate/inputs.h"
#include "fleet/measurement.h"

namespace focalfleet {

/// The purpose of an exposure.
enum class Look : std::uint8_t {
  kBefore,  // units of unknown place are to be found before any unit moves
  kAfter,   // all have arrived
  kOnly,    // nothing else was asked for
};

/// Fills in rms, median and worst of the units' distances from their targets. No effect without
/// any. Units: um.
void Summarise(std::vector<double> errors_um, MeasuredRound* round);

class ConfigurationMeasurement {
 public:
  /// `configuration` outlives this.
  ConfigurationMeasurement(const Coordination& fleet, Configuration* configuration)
      : fleet_(fleet), configuration_(*configuration) {}

  /// A configuration begins: nothing has been measured.
  void Begin();
  /// True where units of unknown place have targets and no exposure has been tried for them.
  [[nodiscard]] bool LooksFirst() const;
  /// Begins to measure. Pre: all units rest.
  void Start(Look look);
  [[nodiscard]] Look look() const { return look_; }

  enum class Progress : std::uint8_t {
    kUnderWay,
    kTaken,   // the findings are taken in, the counts of units that were lost included
    kFailed,  // too many exposures could not be used; `failure()` says why
  };
  /// Asks for the exposure when the arrivals are durable and the sensors are read.
  [[nodiscard]] Progress Advance();
  [[nodiscard]] Progress OnExposure(const ExposureDone& done);
  [[nodiscard]] const std::string& failure() const { return failure_; }
  [[nodiscard]] bool IsAsked() const { return exposure_ != 0; }  // the exposure is under way
  /// Everything of the last exposure is durable.
  [[nodiscard]] bool IsDurable() const {
    return fleet_.ledger.committed_through() >= measured_batch_;
  }

 private:
  [[nodiscard]] bool SensorsAreRead();
  void AskForExposure();
  void Take(const ExposureFindings& exposure, const Measurement& measurement, MeasuredRound* round);
  void TakeFibreCarrier(PositionerIndex i, const Measurement& measurement) const;
  [[nodiscard]] MeasurementRow RowOf(const ExposureFindings& exposure,
                                     const Measurement& measurement) const;
  void WarnOf(const Measurement& measurement) const;
  [[nodiscard]] Progress Refuse(const Error& error);
  [[nodiscard]] Progress EndWhenLocated();

  const Coordination fleet_;
  Configuration& configuration_;
  Look look_ = Look::kAfter;
  std::uint64_t exposure_ = 0;  // asked for; 0: none
  HostInstant exposure_asked_;
  HostInstant sense_at_ = kNever;  // the sensors of units are read from then on
  HostInstant sense_until_{0};     // a unit that is read anew is awaited until then
  bool sensing_ = false;           // the sensors are being read
  int exposures_refused_ = 0;
  bool looked_first_ = false;
  bool is_locating_ = false;          // the counts of units that were found are being set
  std::uint64_t measured_batch_ = 0;  // with which the last exposure becomes durable; 0: none
  std::string failure_;
};

}  // namespace focalfleet
