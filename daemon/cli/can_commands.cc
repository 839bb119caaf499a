// The command can decode explains in words what candump wrote.

#include <fmt/format.h>

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <system_error>

#include "daemon/cli/command_line.h"
#include "fleet/files/foreign_format.h"
#include "protocol/wire/candump_line.h"
#include "protocol/wire/codec.h"
#include "protocol/wire/message_rows.h"

namespace focalfleet::cli {
namespace {

struct CanDecodeOptions {
  std::string file = "-";
};

template <class Frame>
std::string HexData(const Frame& frame) {
  std::string text;
  for (const std::uint8_t byte : frame.payload()) text += fmt::format("{:02X}", byte);
  return text;
}

/// The rule that the frame breaks; null where it breaks none.
const char* Broken(const CanFrame& frame) {
  const auto host = DecodeHost(frame);
  if (host) return nullptr;
  const auto unit = DecodeUnit(frame);
  if (unit) return nullptr;
  return Name(host.error() == Malformed::kDirection ? unit.error() : host.error());
}

struct Route {
  bool from_unit = false;
  NodeId node;
  unsigned sequence = 0;
};
Route RouteOf(const CanFrame& frame) {
  return {
      (frame.id >> 19 & 1) != 0, {static_cast<std::uint8_t>(frame.id >> 11)}, frame.id >> 3 & 255};
}

Json FieldsJson(const MessageRow& row, const CanFrame& frame) {
  Json fields = Json::object();
  for (const FieldRow& field : row.fields) {
    const std::int64_t value = ValueOf(field, frame);
    if (field.names.empty())
      fields[field.name] = value;
    else
      fields[field.name] = field.names[static_cast<std::size_t>(value)];
  }
  return fields;
}

Json JsonOf(const CandumpLine& line) {
  Json object{{"time", std::string(line.time)}, {"interface", std::string(line.interface)}};
  if (line.foreign != nullptr) {
    object["foreign"] = line.foreign;
    return object;
  }
  const Route route = RouteOf(line.frame);
  object["id"] = fmt::format("{:08X}", line.frame.id);
  object["data"] = HexData(line.frame);
  if (const char* broken = Broken(line.frame)) {
    object["malformed"] = broken;
    return object;
  }
  const MessageRow& row = *RowOf(line.frame);
  object["message"] = row.name;
  object["from"] = route.from_unit ? "unit" : "host";
  object["node"] = route.node.value;
  object["sequence"] = route.sequence;
  object["fields"] = FieldsJson(row, line.frame);
  return object;
}

std::string WordsOf(const CandumpLine& line) {
  std::string text = line.time.empty() ? "" : fmt::format("{}  ", line.time);
  text += fmt::format("{}  ", line.interface);
  if (line.foreign != nullptr) return text + fmt::format("not ours: {}\n", line.foreign);
  if (const char* broken = Broken(line.frame))
    return text +
           fmt::format("malformed ({}): {:08X}#{}\n", broken, line.frame.id, HexData(line.frame));
  const Route route = RouteOf(line.frame);
  const std::string node =
      route.node == kBroadcastNode ? "all" : fmt::format("{}", route.node.value);
  text += fmt::format("{:>3} {} host  #{:<3}  {}", node, route.from_unit ? "->" : "<-",
                      route.sequence, RowOf(line.frame)->name);
  const Json fields = FieldsJson(*RowOf(line.frame), line.frame);
  for (const FieldRow& field : RowOf(line.frame)->fields) {
    const Json& value = fields[field.name];
    text += fmt::format("  {} {}", field.name,
                        value.is_string() ? value.get<std::string>() : value.dump());
  }
  return text + "\n";
}

/// Prints a line for each frame of a group, as if it had come alone; a single line where the group
/// is invalid.
void PrintGroup(const Context& context, const CandumpLine& line) {
  const auto entries = UnpackGroup(*line.group);
  if (!entries) {
    const std::string data = HexData(*line.group);
    if (context.json)
      PrintJson({{"time", std::string(line.time)},
                 {"interface", std::string(line.interface)},
                 {"id", fmt::format("{:08X}", line.group->id)},
                 {"data", data},
                 {"malformed", Name(entries.error())}});
    else
      PrintText(fmt::format("{}{}  malformed ({}): {:08X}##{}\n",
                            line.time.empty() ? "" : fmt::format("{}  ", line.time), line.interface,
                            Name(entries.error()), line.group->id, data));
    return;
  }
  CandumpLine one = line;
  for (std::size_t i = 0; i < entries->count; ++i) {
    one.frame = entries->frame[i];
    Json object = JsonOf(one);
    object["group"] = i + 1;
    if (context.json)
      PrintJson(object);
    else
      PrintText(WordsOf(one));
  }
}

struct Tally {
  std::uint64_t lines = 0;
  std::uint64_t bad = 0;
  std::uint64_t first_bad = 0;
  std::uint64_t passed_over = 0;  // words of candump that describe no frame
  std::int64_t dropped = 0;       // frames, as candump counted them
};

/// The error frame that the words of the next lines describe.
struct ErrorFrame {
  std::string time;
  std::string interface;
};

void PrintNote(const Context& context, const CandumpNote& note, const ErrorFrame& of,
               Tally* tally) {
  switch (note.kind) {
    case CandumpNote::Kind::kErrorWords:
      if (context.json)
        PrintJson(
            {{"time", of.time}, {"interface", of.interface}, {"error", std::string(note.text)}});
      else
        PrintText(fmt::format("{}{}  error frame: {}\n",
                              of.time.empty() ? "" : fmt::format("{}  ", of.time), of.interface,
                              note.text));
      return;
    case CandumpNote::Kind::kDropped:
      tally->dropped += note.dropped;
      if (context.json)
        PrintJson({{"interface", std::string(note.interface)},
                   {"dropped", note.dropped},
                   {"dropped_total", note.dropped_total}});
      else
        PrintText(fmt::format("{}  dropped {} (in all {})\n", note.interface,
                              Count(static_cast<std::uint64_t>(note.dropped), "frame", "frames"),
                              note.dropped_total));
      return;
    case CandumpNote::Kind::kOther:
      ++tally->passed_over;
  }
}

// Each line is decoded and printed at once, so that candump may keep running before it in a pipe.
Result<Tally> DecodeAll(const Context& context, const std::string& name, std::istream& in) {
  Tally tally;
  ErrorFrame error_frame;
  for (std::string raw; OutputError() == 0 && std::getline(in, raw);) {
    if (tally.lines++ == 0)
      if (const auto format = ForeignFormat(raw))
        return Fail(ErrorCode::kInvalid, fmt::format("{}: this is {}", name, *format));
    const std::string line = WithoutDecoration(raw);
    if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
    if (const auto note = ParseCandumpNote(line)) {
      PrintNote(context, *note, error_frame, &tally);
      continue;
    }
    const auto parsed = ParseCandumpLine(line);
    if (!parsed) {
      if (tally.bad++ == 0) tally.first_bad = tally.lines;
      Complain(
          fmt::format("{}:{}: not a line of candump: {}\n", name, tally.lines, parsed.error()));
      continue;
    }
    error_frame = {std::string(parsed->time), std::string(parsed->interface)};
    if (parsed->group)
      PrintGroup(context, *parsed);
    else if (context.json)
      PrintJson(JsonOf(*parsed));
    else
      PrintText(WordsOf(*parsed));
  }
  return tally;
}

/// Reports what the frames alone do not show.
void ReportTally(const Context& context, const std::string& name, const Tally& tally) {
  if (context.quiet) return;
  if (tally.dropped != 0)
    Complain(fmt::format(
        "focalfleet: {}: {} missing: candump could not keep up\n", name,
        tally.dropped == 1 ? "1 frame is" : fmt::format("{} frames are", tally.dropped)));
  if (tally.passed_over > 0)
    Complain(fmt::format("focalfleet: {}: {} of candump's own words passed over\n", name,
                         Count(tally.passed_over, "line", "lines")));
}

ExitCode RunCanDecode(const Context& context, const CanDecodeOptions& options) {
  const bool from_stdin = options.file == "-";
  const std::string name = from_stdin ? "standard input" : options.file;
  std::ifstream file;
  if (!from_stdin) {
    file.open(options.file, std::ios::binary);
    const std::error_code why(errno, std::generic_category());
    std::error_code ignored;
    if (!file || std::filesystem::is_directory(options.file, ignored))
      return Report(context, {ErrorCode::kUnavailable,
                              fmt::format("{}: {}", name, file ? "a directory" : why.message())});
  }
  const auto tally = DecodeAll(context, name, from_stdin ? std::cin : file);
  if (!tally) return Report(context, tally.error());
  ReportTally(context, name, *tally);
  if (tally->bad == 0) return ExitCode::kOk;
  return Report(context,
                {ErrorCode::kInvalid,
                 fmt::format("{}: {} of {} not candump's, first {}:{}", name, tally->bad,
                             Count(tally->lines, "line", "lines"), name, tally->first_bad)});
}

}  // namespace

void AddCanCommands(CommandLine* line) {
  CLI::App* can = line->app.add_subcommand("can", "Look at the buses' frames");
  can->require_subcommand(1);
  CLI::App* command = AddCommand(can, "decode", "What candump wrote, in words",
                                 "  focalfleet can decode candump-2026-02-01_201500.log\n"
                                 "  candump -ta any | focalfleet can decode --json | jq .message");
  auto options = std::make_shared<CanDecodeOptions>();
  AddFile(command, "log", &options->file,
          "Log of candump -l, or what candump prints; - or nothing is standard input");
  OnChosen(line, command, options, RunCanDecode);
}

}  // namespace focalfleet::cli
