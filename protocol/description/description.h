// The wire, described for other programs and for people. Each description is one text from the
// codec's own tables: a DBC file for CAN tools, a dissector for Wireshark, and the frames of
// docs/protocol.md. A test compares the committed files with what these functions return.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "protocol/wire/message_rows.h"

namespace focalfleet {

/// A DBC file describes whole identifiers and has no fields within them. Each frame therefore
/// stands in it with node 0 and sequence 0, once for every value of its detail. A reader masks the
/// identifier of a received frame with these bits.
inline constexpr std::uint32_t kDescribedIdentifierBits = 0x1FF80007;

/// A frame of one row, with one value of its detail.
struct DescribedFrame {
  const MessageRow* row = nullptr;
  std::uint32_t id = 0;  // within kDescribedIdentifierBits
  std::string name;      // of the row, and of the detail's value where the row has several
};
std::vector<DescribedFrame> DescribedFrames();

std::string DbcText();
std::string DissectorText();  // Lua
std::string FramesPage();     // Markdown

}  // namespace focalfleet
