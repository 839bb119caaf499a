// The configuration of the coordinator: bit rates, waiting times, and how a measured configuration
// approaches its targets. The defaults are those of fleet.toml.
#pragma once

#include <array>
#include <cstdint>

#include "fleet/drive.h"
#include "protocol/base/instants.h"

namespace focalfleet {

struct CoordinatorConfig {
  std::uint32_t bit_rate_bps = 1'000'000;
  std::uint32_t data_bit_rate_bps = 0;  // of groups on buses with CAN FD (docs/adr/0008); 0: none
  DurationNs reply_wait =
      Milliseconds(50);  // one request's answer; repeats wait 2, 4, 8, 16 times that
  DurationNs identify_period = Milliseconds(2000);  // absent and silent units are asked again
  DurationNs poll_period =
      Milliseconds(1000);  // progress of each moving unit; health of each resting one x10
  /// The time from the end of a unit by itself to the stop of the units that would come where it
  /// stands. Plans are made with it, unless reply_wait asks for more
  /// (fleet/coordinate/stall_detection.h).
  DurationNs notice = Milliseconds(1000);
  DurationNs clock_period = Milliseconds(500);
  DurationNs start_delay = Milliseconds(250);    // start frame to start instant, all buses
  DurationNs settle_margin = Milliseconds(500);  // after the predicted end before a unit is asked
  DurationNs transmit_horizon =
      Milliseconds(4);  // how far ahead of the bit clock frames are released
  DurationNs silence_limit = Milliseconds(3000);  // without an answer: silent
  /// In this time a new daemon has found buses and DDS as they are: a link is reported when its
  /// port is opened, and the first attempt to join DDS takes 5 s of real time at most. Half would
  /// end the alarm of a slow joining too early; twice as much would only show an old one longer.
  DurationNs confirm_within = Milliseconds(10'000);
  /// With a SYNC line an edge signals the common start. Start frames then name an instant
  /// `sync_lead` after it, for units that have no such line or miss the edge.
  bool sync_line = false;
  bool in_plane = false;  // the daemon owns one sector of a plane (fleet/coordinate/sector_round.h)
  bool reads_sensors = false;  // of units that have some (units.csv, [hall] model)
  bool has_camera = false;     // its own or its plane's; else a configuration that asks for one is
                               // refused
  DurationNs sync_lead = Milliseconds(5);
  /// The last piece of each axis' way in a measured configuration, with its direction. Play and
  /// wind-up of a gear are then always on one side. 0: no such piece.
  std::array<double, kAxisCount> approach_deg = {-2, -2};
  /// A correction that is not the last ends this far short of the target where it needed a
  /// unidirectional approach. The last way is then short and goes on in the same direction: a long
  /// way scatters, a short one does not. The default is three times the scatter of a unidirectional
  /// approach there and back.
  double creep_deg = 0.06;
  /// Scale of the scatter of an axis' end. After a way d the standard deviation is
  /// scatter_deg * sqrt(2 (1 - exp(-d / 360 deg))), as robots in service have it.
  double scatter_deg = 0.12;
};

}  // namespace focalfleet
