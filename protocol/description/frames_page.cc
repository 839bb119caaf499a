#include "protocol/description/description.h"

namespace focalfleet {
namespace {

// The place of a field: 16-23, or 2.0-2.2 for bits within a byte, or "detail".
std::string Place(const FieldRow& field) {
  if (field.in_detail) return "detail";
  const unsigned last_bit = field.first_bit + field.bits - 1u;
  const std::string first_byte = std::to_string(field.first_bit / 8);
  const std::string last_byte = std::to_string(last_bit / 8);
  if (field.bits % 8 == 0)
    return first_byte == last_byte ? first_byte : first_byte + "-" + last_byte;
  const std::string first = first_byte + "." + std::to_string(field.first_bit % 8);
  return field.bits == 1 ? first : first + "-" + last_byte + "." + std::to_string(last_bit % 8);
}

std::string Type(const FieldRow& field) {
  return (field.is_signed ? "i" : "u") + std::to_string(field.bits);
}

std::string Values(const FieldRow& field) {
  if (!field.names.empty()) {
    std::string text;
    for (std::size_t i = 0; i < field.names.size(); ++i)
      text += (i == 0 ? "" : ", ") + std::to_string(i) + " " + field.names[i];
    return text;
  }
  return std::to_string(field.min) + ".." + std::to_string(field.max);
}

std::string Heading(const MessageRow& row) {
  return std::string("**") + row.name + "** " +
         (row.from_unit ? "(unit to host" : "(host to unit") + ", function " +
         std::to_string(static_cast<unsigned>(row.function)) + ", priority " +
         std::to_string(InfoOf(row.function).priority) + ", detail " +
         (row.detail_field() != nullptr ? row.detail_field()->name : std::to_string(row.detail)) +
         ", " + std::to_string(row.length) + " bytes)\n";
}

}  // namespace

std::string FramesPage() {
  std::string text;
  for (const MessageRow& row : MessageRows()) {
    text += Heading(row);
    if (!row.fields.empty())
      text += "\n| byte.bit | field | type | values | unit |\n|---|---|---|---|---|\n";
    for (const FieldRow& field : row.fields)
      text += "| " + Place(field) + " | " + field.name + " | " + Type(field) + " | " +
              Values(field) + " | " + field.unit + " |\n";
    text += "\n";
  }
  return text;
}

}  // namespace focalfleet
