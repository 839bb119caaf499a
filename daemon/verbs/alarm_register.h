// The register of open alarms, kept by the core thread. Alarms and ends of conditions are taken out
// of each step's rows, and rows that make the register durable are added to the same batch.
// Acknowledgements and mutes of operators are kept likewise, so a new daemon goes on with all of
// it. Muting changes what is shown as open, never what is logged or stored.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "daemon/clock/wall_time.h"
#include "fleet/records.h"
#include "protocol/base/result.h"

namespace focalfleet {

class AlarmRegister {
 public:
  struct Counts {
    std::size_t open = 0;                // neither acknowledged nor muted
    std::size_t muted = 0;               // open, but muted
    std::optional<Severity> worst = {};  // of those that are open; none: none is
  };

  AlarmRegister() = default;
  /// Goes on with what the store holds.
  explicit AlarmRegister(const StoredFleet& stored);

  /// Alarms of `rows` are open, and those whose conditions ended are over. The changed entries are
  /// appended to `rows`. Cost: a look-up for each alarm.
  void Take(WallTime now, std::vector<Row>* rows);
  /// An alarm that no store can keep, of the store itself; `error` says why it fails. An empty
  /// one: the store can be written again.
  void NoteStore(WallTime now, const std::optional<Error>& error);

  // ---- changes by operators: the rows make them durable; an error changes nothing

  /// The named alarms are acknowledged; all open ones of a name, or single ones by id. Errors:
  /// kInvalid names an id or a name that is not open.
  Result<std::vector<Row>> Acknowledge(const std::vector<std::uint64_t>& ids,
                                       const std::vector<std::string>& names, const std::string& by,
                                       WallTime now);
  /// Errors: kInvalid: there is no such name, or the end is not in the future.
  Result<std::vector<Row>> Mute(const std::string& name, WallTime until, const std::string& reason,
                                const std::string& by, WallTime now);
  /// Errors: kInvalid: there is no such name; kRefused: it is not muted.
  Result<std::vector<Row>> Unmute(const std::string& name, const std::string& by, WallTime now);

  /// Alarms that are not over, by id.
  [[nodiscard]] std::vector<OpenAlarmRow> Lasting() const;
  [[nodiscard]] std::vector<MuteRow> Mutes(WallTime now) const;
  [[nodiscard]] bool IsMuted(AlarmName name, WallTime now) const;
  [[nodiscard]] Counts Count(WallTime now) const;

 private:
  /// Equal alarms have equal keys.
  using Key = std::tuple<AlarmName, std::optional<UnitId>, std::optional<BusId>>;

  const OpenAlarmRow* Raise(const AlarmRow& alarm, WallTime now);

  std::map<Key, OpenAlarmRow> lasting_;
  std::map<AlarmName, MuteRow> mutes_;
};

}  // namespace focalfleet
