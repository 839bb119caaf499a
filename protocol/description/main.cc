// describe_protocol dbc | dissector | frames prints protocol/focalfleet.dbc,
// protocol/focalfleet.lua, or the part of docs/protocol.md between its marks, as committed.
#include <cstdio>
#include <string_view>

#include "protocol/description/description.h"

int main(int count, char** arguments) {
  const std::string_view what = count == 2 ? arguments[1] : "";
  std::string text;
  if (what == "dbc") text = focalfleet::DbcText();
  if (what == "dissector") text = focalfleet::DissectorText();
  if (what == "frames") text = focalfleet::FramesPage();
  if (text.empty()) {
    std::fputs("usage: describe_protocol dbc | dissector | frames\n", stderr);
    return 2;
  }
  return std::fputs(text.c_str(), stdout) >= 0 && std::fflush(stdout) == 0 ? 0 : 1;
}
