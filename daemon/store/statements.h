// The statements with which the writer writes. Each is prepared once, when the store is opened.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "daemon/store/sqlite.h"
#include "protocol/base/result.h"

namespace focalfleet::store_internal {

enum class Sql : std::uint8_t {
  kBegin,
  kCommit,
  kAxis,
  kAxisChanged,
  kIntent,
  kIntentEnd,
  kCountedAnew,
  kReplaced,
  kUnboundElsewhere,
  kUnbindElsewhere,
  kBind,
  kEnable,
  kUnitChanged,
  kParameterChanged,
  kParameter,
  kTuningKept,
  kTuning,
  kMeasurement,
  kOrientation,
  kConfiguration,
  kAlarm,
  kOpenAlarm,
  kMute,
  kModel,
  kModelChange,
  kRaiseMeta,
  kSetMeta,
  kAddMeta,
  kAudit,
  kAuditHead,
};
inline constexpr std::size_t kSqlCount = static_cast<std::size_t>(Sql::kAuditHead) + 1;

class Statements {
 public:
  Statement& operator[](Sql which) { return statements_[static_cast<std::size_t>(which)]; }

 private:
  std::array<Statement, kSqlCount> statements_;
};

/// All statements are prepared. Pre: the connection's schema is the present one. Errors: as
/// Connection::Prepare.
Result<std::unique_ptr<Statements>> PrepareAll(Connection& connection);

}  // namespace focalfleet::store_internal
