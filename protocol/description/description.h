// The wire, described for other programs and for people, each as one text from the codec's own
// tables: a DBC file for CAN tools, a dissector for Wireshark, the frames of docs/protocol.md. What
// is committed of them is what these functions return; a test compares.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "protocol/wire/message_rows.h"

namespace focalfleet {

/// A DBC file knows identifiers, not fields of identifiers. So each frame stands in it with node 0
/// and sequence 0, once for every value of its detail; a reader masks what it hears with this.
inline constexpr std::uint32_t kDescribedIdentifierBits = 0x1FF80007;

/// A frame of one row with one value of its detail.
struct DescribedFrame {
  const MessageRow* row = nullptr;
  std::uint32_t id = 0;  // within kDescribedIdentifierBits
  std::string name;      // of the row, and of the detail's value where it has several
};
std::vector<DescribedFrame> DescribedFrames();

std::string DbcText();
std::string DissectorText();  // Lua
std::string FramesPage();     // Markdown

}  // namespace focalfleet
