#include "protocol/description/description.h"

namespace focalfleet {
namespace {

constexpr const char* kHead =
    R"lua(-- focalfleet's frames in Wireshark and tshark, on any capture with SocketCAN frames:
--   tshark -X lua_script:focalfleet.lua -r bus.pcap -Y 'focalfleet.move == 7'
-- Written by describe_protocol from the tables of the codec; edit those.

local focalfleet = Proto("focalfleet", "focalfleet")
)lua";

constexpr const char* kLogic = R"lua(
local can_id = Field.new("can.id")
local can_extended = Field.new("can.flags.xtd")
local can_remote = Field.new("can.flags.rtr")
local can_error = Field.new("can.flags.err")
local can_length = Field.new("can.len")

local fields = {
  name = ProtoField.string("focalfleet.message", "message"),
  node = ProtoField.uint8("focalfleet.node", "node"),
  sequence = ProtoField.uint8("focalfleet.sequence", "sequence"),
  malformed = ProtoField.string("focalfleet.malformed", "malformed"),
}
for _, message in ipairs(messages) do
  for _, field in ipairs(message.fields) do
    local kind = field.signed and ProtoField.int32 or ProtoField.uint32
    if field.bits > 32 then kind = ProtoField.uint64 end
    local name = "focalfleet." .. field.name
    fields["of " .. field.name] = fields["of " .. field.name]
      or (field.bits > 32 and kind(name, field.name)
          or kind(name, field.name, base.DEC, field.names))
  end
end
focalfleet.fields = {}
for key, field in pairs(fields) do focalfleet.fields[key] = field end

local function bits_of(number, first, count)
  return math.floor(number / 2 ^ first) % 2 ^ count
end

-- The value of a field, the bytes that it stands in, and the value as a tree takes it.
local function value_of(field, detail, data)
  if field.detail then return detail, nil, detail end
  local first, last = math.floor(field.first / 8), math.floor((field.first + field.bits - 1) / 8)
  local range = data(first, last - first + 1)
  if field.bits > 32 then return range:le_uint64():tonumber(), range, range:le_uint64() end
  if field.signed then return range:le_int(), range, range:le_int() end
  local value = bits_of(range:le_uint(), field.first % 8, field.bits)
  return value, range, value
end

local function reserved_bits_are_set(message, data)
  for byte, mask in pairs(message.reserved) do
    local set = data(byte, 1):uint()
    for bit = 0, 7 do
      if bits_of(mask, bit, 1) == 1 and bits_of(set, bit, 1) == 1 then return true end
    end
  end
  return false
end

-- What no single field says of a vector reply.
local function is_position(values)
  local position = values.turns * values.subdivision + values.vector
  return values.vector < values.subdivision and math.abs(position) <= 8388607
end

local function find(id, length)
  local found
  for _, message in ipairs(messages) do
    if bits_of(id, 20, 9) == message.head and bits_of(id, 19, 1) == message.from_unit then
      if not found or message.constant_detail == bits_of(id, 0, 3) then found = message end
    end
  end
  if found and found.from_unit == 1 and bits_of(id, 11, 8) == 255 then return nil end
  return found
end

local function show(message, id, data, length, tree)
  local problem
  tree:add(fields.name, message.name)
  tree:add(fields.node, bits_of(id, 11, 8))
  tree:add(fields.sequence, bits_of(id, 3, 8))
  local detail = bits_of(id, 0, 3)
  if length ~= message.length then return "length" end
  if message.constant_detail and detail ~= message.constant_detail then return "reserved" end
  if reserved_bits_are_set(message, data) then problem = "reserved" end
  local values = {}
  for _, field in ipairs(message.fields) do
    local value, range, shown = value_of(field, detail, data)
    values[field.name] = value
    if range then
      tree:add(fields["of " .. field.name], range, shown)
    else
      tree:add(fields["of " .. field.name], shown)
    end
    if value < field.min or value > field.max then
      problem = problem or (field.detail and "reserved" or "value")
    end
  end
  if message.name == "vector_reply" and not is_position(values) then
    problem = problem or "value"
  end
  return problem
end

-- After all others, because frames without data reach no other dissector.
function focalfleet.dissector(data, pinfo, tree)
  local id = can_id()
  if not id or not can_extended() or not can_extended().value then return end
  if (can_remote() and can_remote().value) or (can_error() and can_error().value) then return end
  local length = can_length().value
  local number = bits_of(id.value, 0, 29)
  local message = find(number, length)
  if not message then return end
  -- A frame as SocketCAN has it: identifier 4, length 1, 3 that do not matter here, data.
  local payload = length > 0 and data(id.offset + 8, length) or nil
  local item = tree:add(focalfleet, "focalfleet " .. message.name)
  local bytes = payload and function(first, count) return payload(first, count) end
  local problem = show(message, number, bytes, length, item)
  if problem then item:add(fields.malformed, problem) end
  pinfo.cols.protocol = "focalfleet"
  pinfo.cols.info = message.name .. (problem and " (malformed: " .. problem .. ")" or "")
end

register_postdissector(focalfleet)
)lua";

std::string Quoted(const char* text) { return "\"" + std::string(text) + "\""; }

std::string LuaField(const FieldRow& field) {
  std::string text = "    {name = " + Quoted(field.name) +
                     ", first = " + std::to_string(field.first_bit) +
                     ", bits = " + std::to_string(field.bits);
  if (field.in_detail) text += ", detail = true";
  if (field.is_signed) text += ", signed = true";
  text += ", min = " + std::to_string(field.min) + ", max = " + std::to_string(field.max);
  if (!field.names.empty()) {
    text += ",\n     names = {";
    for (std::size_t i = 0; i < field.names.size(); ++i)
      text += (i == 0 ? "[" : ", [") + std::to_string(i) + "] = " + Quoted(field.names[i]);
    text += "}";
  }
  return text + "},\n";
}

// The masks of bits that no field covers, as byte = mask.
std::string Reserved(const MessageRow& row) {
  std::string text;
  for (unsigned byte = 0; byte < row.length; ++byte) {
    unsigned mask = 255;
    for (const FieldRow& field : row.fields)
      for (unsigned bit = 0; bit < 8; ++bit)
        if (!field.in_detail && 8 * byte + bit >= field.first_bit &&
            8 * byte + bit < field.first_bit + static_cast<unsigned>(field.bits))
          mask &= ~(1u << bit);
    if (mask != 0)
      text += (text.empty() ? "[" : ", [") + std::to_string(byte) + "] = " + std::to_string(mask);
  }
  return text;
}

}  // namespace

std::string DissectorText() {
  std::string text = kHead;
  text += "\nlocal messages = {\n";
  for (const MessageRow& row : MessageRows()) {
    const unsigned head = static_cast<unsigned>(InfoOf(row.function).priority) << 6 |
                          static_cast<unsigned>(row.function);
    text += "  {name = " + Quoted(row.name) + ", head = " + std::to_string(head) +
            ", from_unit = " + (row.from_unit ? "1" : "0") +
            ", length = " + std::to_string(row.length);
    if (row.detail_field() == nullptr) text += ", constant_detail = " + std::to_string(row.detail);
    text += ", reserved = {" + Reserved(row) + "}, fields = {\n";
    for (const FieldRow& field : row.fields) text += LuaField(field);
    text += "  }},\n";
  }
  return text + "}\n" + kLogic;
}

}  // namespace focalfleet
