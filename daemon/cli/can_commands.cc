// can decode: what candump wrote, in words.

#include <fmt/format.h>

#include <cerrno>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <system_error>

#include "daemon/cli/command_line.h"
#include "daemon/files/text_file.h"
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

/// The rule that it breaks; null where it breaks none.
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

std::string TextOf(const CandumpLine& line) {
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

/// One line for each frame of a group, as if it had come alone; one for a group that is none.
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
      PrintText(TextOf(one));
  }
}

struct Tally {
  std::uint64_t lines = 0;
  std::uint64_t bad = 0;
  std::uint64_t first_bad = 0;
};

// Line by line and each told at once, so that candump may run on before it in a pipe.
Tally DecodeAll(const Context& context, const std::string& name, std::istream& in) {
  Tally tally;
  for (std::string line; OutputError() == 0 && std::getline(in, line);) {
    ++tally.lines;
    if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
    const auto parsed = ParseCandumpLine(line);
    if (!parsed) {
      if (tally.bad++ == 0) tally.first_bad = tally.lines;
      Complain(
          fmt::format("{}:{}: not a line of candump: {}\n", name, tally.lines, parsed.error()));
      continue;
    }
    if (parsed->group)
      PrintGroup(context, *parsed);
    else if (context.json)
      PrintJson(JsonOf(*parsed));
    else
      PrintText(TextOf(*parsed));
  }
  return tally;
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
  const Tally tally = DecodeAll(context, name, from_stdin ? std::cin : file);
  if (tally.bad == 0) return ExitCode::kOk;
  return Report(context, {ErrorCode::kInvalid,
                          fmt::format("{}: {} of {} not candump's, first {}:{}", name, tally.bad,
                                      Count(tally.lines, "line", "lines"), name, tally.first_bad)});
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
