// The first byte of the input picks one of three uses.
//
// Any bytes as a line on a control socket, in both directions, must give a message or an error,
// never more. A value that was read and is written again reads back the same. A request becomes a
// command of units that exist, each once, with texts within their bounds, or is refused with a
// message.
//
// Any bytes as a stream of lines, of which some are urgent. None is lost or doubled, and each line
// that was overtaken is marked so.
//
// Any bytes as a text for a terminal.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <set>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "daemon/control/line_buffer.h"
#include "daemon/control/messages.h"
#include "daemon/control/printable.h"
#include "daemon/verbs/alarm_requests.h"
#include "daemon/verbs/history_requests.h"
#include "daemon/verbs/requested_command.h"
#include "daemon/verbs/unit_selection.h"
#include "protocol/base/check.h"
#include "tests/daemon/verbs/small_fleet.h"

namespace focalfleet {
namespace {

using test::SmallFleet;

constexpr std::uint32_t kUnitCount = 3;

void CheckUnits(const Command& command) {
  const auto exists = [](PositionerIndex i) { FOCALFLEET_CHECK(i.value < kUnitCount); };
  std::visit(
      [&](const auto& what) {
        using What = std::decay_t<decltype(what)>;
        if constexpr (requires { what.reason; })
          FOCALFLEET_CHECK(what.reason.size() <= limits::kTextBytes);
        if constexpr (requires { what.source; })
          FOCALFLEET_CHECK(what.source.size() <= limits::kTextBytes);
        if constexpr (requires { what.units; }) {
          for (const PositionerIndex i : what.units) exists(i);
          FOCALFLEET_CHECK(std::set(what.units.begin(), what.units.end()).size() ==
                           what.units.size());
        } else if constexpr (std::is_same_v<What, StopCommand>) {
          if (what.unit) exists(*what.unit);
        } else if constexpr (std::is_same_v<What, MeasureCommand>) {
          return;  // all units at once
        } else if constexpr (std::is_same_v<What, ApplyCommand>) {
          FOCALFLEET_CHECK(what.targets.size() == kUnitCount);
        } else if constexpr (std::is_same_v<What, KeepRowsCommand>) {
          FOCALFLEET_CHECK(false);  // the request handler makes it itself
        } else if constexpr (requires { what.unit; }) {
          exists(what.unit);
        } else {
          FOCALFLEET_CHECK(false);  // rounds of a plane come through DDS alone
        }
      },
      command.what);
}

/// The verbs about the past, about alarms and about a choice of units take any arguments, too.
void TryQuestions(ControlRequest request, const FleetView& view) {
  constexpr WallTime kNow{1'700'000'000'000'000'000};
  AlarmRegister alarms;
  std::vector<Row> rows{
      AlarmRow{4, Severity::kError, UnitId{1}, {}, "silent", AlarmName::kUnitSilent}};
  alarms.Take(kNow, &rows);
  const auto explained = [](const auto& answer) {
    FOCALFLEET_CHECK(answer || !answer.error().text.empty());
  };
  explained(AskHistory(request, view));
  explained(AskEvents(request, view));
  if (const auto reading = AskAlarms(request, alarms, kNow)) {
    const bool all = request.args.value("all", false);
    if (!all) FOCALFLEET_CHECK((*reading)(nullptr));  // nothing of it is in the store
  } else {
    explained(reading);
  }
  const auto chosen = SelectUnits(request.args, view);
  explained(chosen);
  if (chosen) FOCALFLEET_CHECK(!chosen->empty() && chosen->size() <= kUnitCount);
  for (const char* verb : {"alarms_ack", "alarms_mute", "alarms_unmute"}) {
    request.verb = verb;
    const auto change = ChangeAlarms(request, &alarms, "uid 0", kNow);
    FOCALFLEET_CHECK(change);
    explained(*change);
  }
}

void TryRequest(std::string_view line) {
  const auto request = DecodeRequest(line);
  if (!request) {
    FOCALFLEET_CHECK(!request.error().text.empty());
    return;
  }
  const auto again = DecodeRequest(EncodeRequest(*request));
  FOCALFLEET_CHECK(again && again->id == request->id && again->verb == request->verb);
  FOCALFLEET_CHECK(again->args == request->args);
  static const SmallFleet fleet(kUnitCount);
  TryQuestions(*request, fleet.View());
  const auto command = CommandOf(*request, fleet.View());
  if (command) {
    CheckUnits(*command);
  } else {
    FOCALFLEET_CHECK(!command.error().text.empty());
  }
}

void TryAnswer(std::string_view line) {
  const auto answer = DecodeAnswer(line);
  if (!answer) {
    FOCALFLEET_CHECK(!answer.error().text.empty());
    return;
  }
  using Kind = ControlAnswer::Kind;
  const std::string written = answer->kind == Kind::kError ? EncodeError(answer->id, answer->error)
                              : answer->kind == Kind::kProgress
                                  ? EncodeProgress(answer->id, answer->body)
                                  : EncodeResult(answer->id, answer->body);
  const auto again = DecodeAnswer(written);
  FOCALFLEET_CHECK(again && again->id == answer->id && again->kind == answer->kind);
  FOCALFLEET_CHECK(again->body == answer->body && again->error.code == answer->error.code);
}

bool IsUrgent(std::string_view line) { return line.starts_with('s'); }

/// Pre: `text` is not empty; its first byte gives the sizes of the pieces in which the rest
/// arrives.
void TryStream(std::string_view text) {
  const std::size_t piece = 1 + static_cast<unsigned char>(text[0]) % 16;
  text.remove_prefix(1);
  LineBuffer buffer;
  std::vector<std::string> taken;
  bool any_urgent = false;
  for (std::size_t at = 0; at < text.size(); at += piece) {
    buffer.Append(text.substr(at, piece));
    while (auto line = buffer.TakeUrgent(IsUrgent)) {
      any_urgent = true;
      taken.push_back(std::move(*line));
    }
    // A line is taken now and then; by now all urgent lines have been taken.
    if (at / piece % 3 != 0) continue;
    if (auto line = buffer.Take()) {
      FOCALFLEET_CHECK(!IsUrgent(line->text) && (any_urgent || !line->overtaken));
      taken.push_back(std::move(line->text));
    }
  }
  while (auto line = buffer.Take()) taken.push_back(std::move(line->text));
  FOCALFLEET_CHECK(!buffer.unseen());
  std::vector<std::string> sent;
  for (std::size_t end = text.find('\n'); end != std::string_view::npos; end = text.find('\n')) {
    sent.emplace_back(text.substr(0, end));
    text.remove_prefix(end + 1);
  }
  FOCALFLEET_CHECK(buffer.size() == text.size());
  std::ranges::sort(sent);
  std::ranges::sort(taken);
  FOCALFLEET_CHECK(sent == taken);
}

void TryText(std::string_view text) {
  const std::string clean = Printable(text);
  for (const char c : clean)
    FOCALFLEET_CHECK(static_cast<unsigned char>(c) >= 0x20 &&
                     static_cast<unsigned char>(c) != 0x7f);
  FOCALFLEET_CHECK(Printable(clean) == clean);
  // The value of a JSON text stays the same.
  const std::string line = Json(clean).dump();
  FOCALFLEET_CHECK(Json::parse(PrintableJson(line)) == Json(clean));
}

}  // namespace
}  // namespace focalfleet

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string_view line(static_cast<const char*>(static_cast<const void*>(data + 1)),
                              size - 1);
  switch (data[0] % 4) {
    case 0:
      focalfleet::TryRequest(line);
      break;
    case 1:
      focalfleet::TryAnswer(line);
      break;
    case 2:
      if (!line.empty()) focalfleet::TryStream(line);
      break;
    default:
      focalfleet::TryText(line);
  }
  return 0;
}
