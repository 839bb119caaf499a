-- focalfleet's frames in Wireshark and tshark, on any capture with SocketCAN frames:
--   tshark -X lua_script:focalfleet.lua -r bus.pcap -Y 'focalfleet.move == 7'
-- Written by describe_protocol from the tables of the codec; edit those.

local focalfleet = Proto("focalfleet", "focalfleet")

local messages = {
  {name = "stop", head = 0, from_unit = 0, length = 0, constant_detail = 0, reserved = {}, fields = {
  }},
  {name = "start", head = 65, from_unit = 0, length = 5, constant_detail = 0, reserved = {}, fields = {
    {name = "move", first = 0, bits = 16, min = 0, max = 65535},
    {name = "delay_ticks", first = 16, bits = 24, min = 0, max = 16777215},
  }},
  {name = "clock", head = 131, from_unit = 0, length = 6, constant_detail = 0, reserved = {}, fields = {
    {name = "host_us", first = 0, bits = 48, min = 0, max = 281474976710655},
  }},
  {name = "clock_request", head = 131, from_unit = 0, length = 0, constant_detail = 1, reserved = {}, fields = {
  }},
  {name = "arm", head = 196, from_unit = 0, length = 6, constant_detail = 0, reserved = {}, fields = {
    {name = "move", first = 0, bits = 16, min = 0, max = 65535},
    {name = "digest", first = 16, bits = 32, min = 0, max = 4294967295},
  }},
  {name = "stage_begin", head = 261, from_unit = 0, length = 5, constant_detail = 0, reserved = {}, fields = {
    {name = "move", first = 0, bits = 16, min = 1, max = 65535},
    {name = "theta_segments", first = 16, bits = 8, min = 0, max = 15},
    {name = "phi_segments", first = 24, bits = 8, min = 0, max = 15},
    {name = "mode", first = 32, bits = 8, min = 0, max = 2,
     names = {[0] = "asymmetric", [1] = "five_segment", [2] = "seven_segment"}},
  }},
  {name = "stage_segment", head = 262, from_unit = 0, length = 8, reserved = {}, fields = {
    {name = "axis", first = 0, bits = 3, detail = true, min = 0, max = 1,
     names = {[0] = "theta", [1] = "phi"}},
    {name = "index", first = 0, bits = 8, min = 0, max = 14},
    {name = "start_ticks", first = 8, bits = 24, min = 0, max = 16777215},
    {name = "delta", first = 32, bits = 24, signed = true, min = -8388608, max = 8388607},
    {name = "repeat", first = 56, bits = 8, min = 1, max = 255},
  }},
  {name = "confirm", head = 263, from_unit = 0, length = 2, constant_detail = 0, reserved = {}, fields = {
    {name = "move", first = 0, bits = 16, min = 0, max = 65535},
  }},
  {name = "home", head = 264, from_unit = 0, length = 2, constant_detail = 0, reserved = {}, fields = {
    {name = "move", first = 0, bits = 16, min = 0, max = 65535},
  }},
  {name = "progress", head = 329, from_unit = 0, length = 0, constant_detail = 0, reserved = {}, fields = {
  }},
  {name = "status", head = 330, from_unit = 0, length = 0, reserved = {}, fields = {
    {name = "resume", first = 0, bits = 3, detail = true, min = 0, max = 1,
     names = {[0] = "no", [1] = "yes"}},
  }},
  {name = "vector", head = 331, from_unit = 0, length = 0, reserved = {}, fields = {
    {name = "axis", first = 0, bits = 3, detail = true, min = 0, max = 1,
     names = {[0] = "theta", [1] = "phi"}},
  }},
  {name = "fault", head = 332, from_unit = 0, length = 0, reserved = {}, fields = {
    {name = "clear", first = 0, bits = 3, detail = true, min = 0, max = 1,
     names = {[0] = "no", [1] = "yes"}},
  }},
  {name = "identify", head = 397, from_unit = 0, length = 0, constant_detail = 0, reserved = {}, fields = {
  }},
  {name = "parameter_read", head = 398, from_unit = 0, length = 1, reserved = {}, fields = {
    {name = "axis", first = 0, bits = 3, detail = true, min = 0, max = 1,
     names = {[0] = "theta", [1] = "phi"}},
    {name = "parameter", first = 0, bits = 8, min = 0, max = 8,
     names = {[0] = "counter1", [1] = "repeat", [2] = "subdivision", [3] = "mode", [4] = "position", [5] = "min_position", [6] = "max_position", [7] = "home_position", [8] = "host_timeout_ms"}},
  }},
  {name = "parameter_write", head = 399, from_unit = 0, length = 5, reserved = {}, fields = {
    {name = "axis", first = 0, bits = 3, detail = true, min = 0, max = 1,
     names = {[0] = "theta", [1] = "phi"}},
    {name = "parameter", first = 0, bits = 8, min = 0, max = 8,
     names = {[0] = "counter1", [1] = "repeat", [2] = "subdivision", [3] = "mode", [4] = "position", [5] = "min_position", [6] = "max_position", [7] = "home_position", [8] = "host_timeout_ms"}},
    {name = "value", first = 8, bits = 32, signed = true, min = -2147483648, max = 2147483647},
  }},
  {name = "sensors", head = 337, from_unit = 0, length = 0, reserved = {}, fields = {
    {name = "part", first = 0, bits = 3, detail = true, min = 0, max = 3,
     names = {[0] = "1_to_4", [1] = "5_to_8", [2] = "9_to_12", [3] = "13_to_16"}},
  }},
  {name = "done", head = 130, from_unit = 1, length = 8, reserved = {}, fields = {
    {name = "outcome", first = 0, bits = 3, detail = true, min = 0, max = 3,
     names = {[0] = "arrived", [1] = "stopped", [2] = "fault", [3] = "homed"}},
    {name = "theta", first = 0, bits = 24, signed = true, min = -8388607, max = 8388607},
    {name = "phi", first = 24, bits = 24, signed = true, min = -8388607, max = 8388607},
    {name = "move", first = 48, bits = 16, min = 0, max = 65535},
  }},
  {name = "clock_reply", head = 131, from_unit = 1, length = 8, constant_detail = 0, reserved = {}, fields = {
    {name = "ticks", first = 0, bits = 32, min = 0, max = 4294967295},
    {name = "began_ticks", first = 32, bits = 32, min = 0, max = 4294967295},
  }},
  {name = "arm_reply", head = 196, from_unit = 1, length = 3, constant_detail = 0, reserved = {}, fields = {
    {name = "move", first = 0, bits = 16, min = 0, max = 65535},
    {name = "answer", first = 16, bits = 8, min = 0, max = 7,
     names = {[0] = "ok", [1] = "wrong_move", [2] = "incomplete", [3] = "out_of_range", [4] = "wrong_state", [5] = "begun_before", [6] = "bad_value", [7] = "interrupted"}},
  }},
  {name = "confirm_reply", head = 263, from_unit = 1, length = 8, constant_detail = 0, reserved = {}, fields = {
    {name = "move", first = 0, bits = 16, min = 0, max = 65535},
    {name = "digest", first = 16, bits = 32, min = 0, max = 4294967295},
    {name = "theta_segments", first = 48, bits = 4, min = 0, max = 15},
    {name = "phi_segments", first = 52, bits = 4, min = 0, max = 15},
    {name = "answer", first = 56, bits = 8, min = 0, max = 7,
     names = {[0] = "ok", [1] = "wrong_move", [2] = "incomplete", [3] = "out_of_range", [4] = "wrong_state", [5] = "begun_before", [6] = "bad_value", [7] = "interrupted"}},
  }},
  {name = "home_reply", head = 264, from_unit = 1, length = 3, constant_detail = 0, reserved = {}, fields = {
    {name = "move", first = 0, bits = 16, min = 0, max = 65535},
    {name = "answer", first = 16, bits = 8, min = 0, max = 7,
     names = {[0] = "ok", [1] = "wrong_move", [2] = "incomplete", [3] = "out_of_range", [4] = "wrong_state", [5] = "begun_before", [6] = "bad_value", [7] = "interrupted"}},
  }},
  {name = "progress_reply", head = 329, from_unit = 1, length = 8, reserved = {}, fields = {
    {name = "state", first = 0, bits = 3, detail = true, min = 0, max = 6,
     names = {[0] = "rest", [1] = "staging", [2] = "armed", [3] = "moving", [4] = "homing", [5] = "fault", [6] = "host_lost"}},
    {name = "theta", first = 0, bits = 24, signed = true, min = -8388607, max = 8388607},
    {name = "phi", first = 24, bits = 24, signed = true, min = -8388607, max = 8388607},
    {name = "move", first = 48, bits = 16, min = 0, max = 65535},
  }},
  {name = "status_reply", head = 330, from_unit = 1, length = 8, constant_detail = 0, reserved = {[2] = 248}, fields = {
    {name = "state", first = 0, bits = 8, min = 0, max = 6,
     names = {[0] = "rest", [1] = "staging", [2] = "armed", [3] = "moving", [4] = "homing", [5] = "fault", [6] = "host_lost"}},
    {name = "fault", first = 8, bits = 8, min = 0, max = 5,
     names = {[0] = "none", [1] = "over_temperature", [2] = "under_voltage", [3] = "over_current", [4] = "flash", [5] = "driver"}},
    {name = "interrupted", first = 16, bits = 1, min = 0, max = 1,
     names = {[0] = "no", [1] = "yes"}},
    {name = "host_lost", first = 17, bits = 1, min = 0, max = 1,
     names = {[0] = "no", [1] = "yes"}},
    {name = "restarted", first = 18, bits = 1, min = 0, max = 1,
     names = {[0] = "no", [1] = "yes"}},
    {name = "progress_percent", first = 24, bits = 8, min = 0, max = 100},
    {name = "move", first = 32, bits = 16, min = 0, max = 65535},
    {name = "moves_begun", first = 48, bits = 16, min = 0, max = 65535},
  }},
  {name = "vector_reply", head = 331, from_unit = 1, length = 8, reserved = {}, fields = {
    {name = "axis", first = 0, bits = 3, detail = true, min = 0, max = 1,
     names = {[0] = "theta", [1] = "phi"}},
    {name = "vector", first = 0, bits = 16, min = 0, max = 65535},
    {name = "subdivision", first = 16, bits = 16, min = 1, max = 65535},
    {name = "turns", first = 32, bits = 32, signed = true, min = -2147483648, max = 2147483647},
  }},
  {name = "fault_reply", head = 332, from_unit = 1, length = 6, constant_detail = 0, reserved = {}, fields = {
    {name = "fault", first = 0, bits = 8, min = 0, max = 5,
     names = {[0] = "none", [1] = "over_temperature", [2] = "under_voltage", [3] = "over_current", [4] = "flash", [5] = "driver"}},
    {name = "axis", first = 8, bits = 8, min = 0, max = 1,
     names = {[0] = "theta", [1] = "phi"}},
    {name = "move", first = 16, bits = 16, min = 0, max = 65535},
    {name = "count", first = 32, bits = 16, min = 0, max = 65535},
  }},
  {name = "identify_reply", head = 397, from_unit = 1, length = 8, constant_detail = 0, reserved = {}, fields = {
    {name = "serial", first = 0, bits = 32, min = 0, max = 4294967295},
    {name = "protocol_version", first = 32, bits = 8, min = 0, max = 255},
    {name = "firmware_major", first = 40, bits = 8, min = 0, max = 255},
    {name = "firmware_minor", first = 48, bits = 8, min = 0, max = 255},
    {name = "hardware", first = 56, bits = 8, min = 0, max = 255},
  }},
  {name = "parameter_read_reply", head = 398, from_unit = 1, length = 6, reserved = {}, fields = {
    {name = "axis", first = 0, bits = 3, detail = true, min = 0, max = 1,
     names = {[0] = "theta", [1] = "phi"}},
    {name = "parameter", first = 0, bits = 8, min = 0, max = 8,
     names = {[0] = "counter1", [1] = "repeat", [2] = "subdivision", [3] = "mode", [4] = "position", [5] = "min_position", [6] = "max_position", [7] = "home_position", [8] = "host_timeout_ms"}},
    {name = "answer", first = 8, bits = 8, min = 0, max = 7,
     names = {[0] = "ok", [1] = "wrong_move", [2] = "incomplete", [3] = "out_of_range", [4] = "wrong_state", [5] = "begun_before", [6] = "bad_value", [7] = "interrupted"}},
    {name = "value", first = 16, bits = 32, signed = true, min = -2147483648, max = 2147483647},
  }},
  {name = "parameter_write_reply", head = 399, from_unit = 1, length = 6, reserved = {}, fields = {
    {name = "axis", first = 0, bits = 3, detail = true, min = 0, max = 1,
     names = {[0] = "theta", [1] = "phi"}},
    {name = "parameter", first = 0, bits = 8, min = 0, max = 8,
     names = {[0] = "counter1", [1] = "repeat", [2] = "subdivision", [3] = "mode", [4] = "position", [5] = "min_position", [6] = "max_position", [7] = "home_position", [8] = "host_timeout_ms"}},
    {name = "answer", first = 8, bits = 8, min = 0, max = 7,
     names = {[0] = "ok", [1] = "wrong_move", [2] = "incomplete", [3] = "out_of_range", [4] = "wrong_state", [5] = "begun_before", [6] = "bad_value", [7] = "interrupted"}},
    {name = "value", first = 16, bits = 32, signed = true, min = -2147483648, max = 2147483647},
  }},
  {name = "sensors_reply", head = 337, from_unit = 1, length = 8, reserved = {}, fields = {
    {name = "part", first = 0, bits = 3, detail = true, min = 0, max = 3,
     names = {[0] = "1_to_4", [1] = "5_to_8", [2] = "9_to_12", [3] = "13_to_16"}},
    {name = "first", first = 0, bits = 16, min = 0, max = 65535},
    {name = "second", first = 16, bits = 16, min = 0, max = 65535},
    {name = "third", first = 32, bits = 16, min = 0, max = 65535},
    {name = "fourth", first = 48, bits = 16, min = 0, max = 65535},
  }},
}

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
