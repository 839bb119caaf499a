#include <cstdio>

#include "protocol/description/description.h"
#include "protocol/wire/codec.h"

namespace focalfleet {
namespace {

constexpr std::uint32_t kExtendedBit = 0x80000000u;

std::string Number(std::uint64_t value) { return std::to_string(value); }

std::string DbcId(const DescribedFrame& frame) { return Number(frame.id | kExtendedBit); }

std::string Signal(const FieldRow& field, bool from_unit) {
  return std::string(" SG_ ") + field.name + " : " + Number(field.first_bit) + "|" +
         Number(field.bits) + "@1" + (field.is_signed ? "-" : "+") + " (1,0) [" +
         std::to_string(field.min) + "|" + std::to_string(field.max) + "] \"" + field.unit + "\" " +
         (from_unit ? "host" : "unit") + "\n";
}

constexpr const char* kHead =
    "VERSION \"\"\n\n"
    "NS_ :\n\n"
    "BS_:\n\n"
    "BU_: host unit\n\n";

constexpr const char* kAttributes =
    "BA_DEF_ BO_ \"VFrameFormat\" ENUM \"StandardCAN\",\"ExtendedCAN\";\n"
    "BA_DEF_ \"IdentifierMask\" INT 0 536870911;\n"
    "BA_DEF_ \"ProtocolVersion\" INT 0 255;\n"
    "BA_DEF_DEF_ \"VFrameFormat\" \"ExtendedCAN\";\n";

}  // namespace

std::vector<DescribedFrame> DescribedFrames() {
  std::vector<DescribedFrame> frames;
  for (const MessageRow& row : MessageRows()) {
    const FieldRow* detail = row.detail_field();
    const std::int64_t last = detail == nullptr ? row.detail : detail->max;
    for (std::int64_t value = detail == nullptr ? row.detail : 0; value <= last; ++value) {
      const std::uint32_t id =
          Pack({row.function, row.from_unit, {}, static_cast<std::uint8_t>(value)});
      std::string name = row.name;
      if (detail != nullptr) {
        // Two values of one name differ in a flag alone; the field's name says what it means.
        const std::string label = detail->names[static_cast<std::size_t>(value)];
        if (label == "yes") name += std::string("_") + detail->name;
        if (label != "yes" && label != "no") name += "_" + label;
      }
      frames.push_back({&row, id, name});
    }
  }
  return frames;
}

std::string DbcText() {
  const std::vector<DescribedFrame> frames = DescribedFrames();
  std::string text = kHead;
  for (const DescribedFrame& frame : frames) {
    text += "BO_ " + DbcId(frame) + " " + frame.name + ": " + Number(frame.row->length) + " " +
            (frame.row->from_unit ? "unit" : "host") + "\n";
    for (const FieldRow& field : frame.row->fields)
      if (!field.in_detail) text += Signal(field, frame.row->from_unit);
    text += "\n";
  }
  char note[200];
  std::snprintf(note, sizeof note,
                "CM_ \"focalfleet, protocol version %u. Identifiers stand for node 0 and sequence "
                "0: compare (identifier & 0x%08X).\";\n\n",
                kProtocolVersion, kDescribedIdentifierBits);
  text += note;
  text += kAttributes;
  text += "BA_DEF_DEF_ \"IdentifierMask\" " + Number(kDescribedIdentifierBits) + ";\n";
  text += "BA_DEF_DEF_ \"ProtocolVersion\" " + Number(kProtocolVersion) + ";\n";
  text += "BA_ \"IdentifierMask\" " + Number(kDescribedIdentifierBits) + ";\n";
  text += "BA_ \"ProtocolVersion\" " + Number(kProtocolVersion) + ";\n";
  for (const DescribedFrame& frame : frames)
    text += "BA_ \"VFrameFormat\" BO_ " + DbcId(frame) + " 1;\n";
  text += "\n";
  for (const DescribedFrame& frame : frames) {
    for (const FieldRow& field : frame.row->fields) {
      if (field.in_detail || field.names.empty()) continue;
      text += "VAL_ " + DbcId(frame) + " " + field.name;
      for (std::size_t value = 0; value < field.names.size(); ++value)
        text += " " + Number(value) + " \"" + field.names[value] + "\"";
      text += " ;\n";
    }
  }
  return text;
}

}  // namespace focalfleet
