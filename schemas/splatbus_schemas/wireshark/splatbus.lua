-- SplatBus for Wireshark and tshark. Written by `python -m splatbus_schemas.wireshark`; what it
-- knows of messages is the metamodel of the protocol.

local METAMODEL = nil

local splatbus = Proto("splatbus", "SplatBus")
local json = Dissector.get("json")

local fields = {
  message = ProtoField.string("splatbus.message", "Message"),
  channel = ProtoField.string("splatbus.channel", "Channel"),
  from = ProtoField.string("splatbus.from", "From"),
  length = ProtoField.uint32("splatbus.length", "Length of the payload"),
}
for name, kind in pairs(METAMODEL.fields) do
  fields["." .. name] = ProtoField[kind]("splatbus." .. name, name)
end
splatbus.fields = fields

local bad_length = ProtoExpert.new("splatbus.bad_length", "A length that no packet has",
  expert.group.MALFORMED, expert.severity.ERROR)
local not_json = ProtoExpert.new("splatbus.not_an_object", "No object of JSON",
  expert.group.MALFORMED, expert.severity.ERROR)
local unknown = ProtoExpert.new("splatbus.unknown", "No message that this end sends here",
  expert.group.PROTOCOL, expert.severity.NOTE)
local beyond = ProtoExpert.new("splatbus.out_of_range", "A number out of its range",
  expert.group.PROTOCOL, expert.severity.WARN)
splatbus.experts = { bad_length, not_json, unknown, beyond }

local default = METAMODEL.ports
splatbus.prefs.ipc_port = Pref.uint("IPC port", default.ipc, "TCP port of the IPC channel")
splatbus.prefs.message_port =
  Pref.uint("Message port", default.message, "TCP port of the message channel")

-- JSON: the members of the outermost object. All of the rest is for the dissector of JSON.

local function end_of_string(text, at)
  at = at + 1
  while true do
    at = text:find('["\\]', at)
    if not at or text:sub(at, at) == '"' then return at end
    at = at + 2
  end
end

local function end_of_value(text, at)
  local first = text:sub(at, at)
  if first == '"' then return end_of_string(text, at) end
  if first ~= "{" and first ~= "[" then return select(2, text:find("^[^,%]}%s]+", at)) end
  local depth = 0
  while true do
    at = text:find('["%[%]{}]', at)
    local sign = at and text:sub(at, at)
    if sign == '"' then
      at = end_of_string(text, at)
    elseif sign then
      depth = depth + ((sign == "{" or sign == "[") and 1 or -1)
    end
    if not at or depth == 0 then return at end
    at = at + 1
  end
end

local function members_of(text)
  local at = text:match("^%s*{()")
  if not at then return nil end
  local found = {}
  while at do
    local name = text:match('^%s*()"', at)
    local name_end = name and end_of_string(text, name)
    local value = name_end and text:match("^%s*:%s*()", name_end + 1)
    local last = value and end_of_value(text, value)
    if not last then break end
    found[text:sub(name + 1, name_end - 1)] = { first = value, text = text:sub(value, last) }
    at = text:match("^%s*,()", last + 1)
  end
  return found
end

local function unquoted(text)
  return text and text:match('^"(.*)"$')
end

-- What a message is

local function share(members, names)
  local found = 0
  for _, name in ipairs(names) do
    if members[name] then found = found + 1 end
  end
  return found / #names
end

-- The message that this end sends here by that type; of those without one, the likest.
local function meaning(members, from, channel)
  local kind = unquoted(members.type and members.type.text)
  local likest, most = nil, 0
  for _, message in ipairs(METAMODEL.messages) do
    if message.from == from and (not channel or message.channels[channel]) then
      if kind and message.type == kind then return message end
      local alike = (kind or message.type) and 0 or share(members, message.required)
      if alike > most then likest, most = message, alike end
    end
  end
  return likest, kind
end

local function ends(pinfo)
  local named = { [splatbus.prefs.ipc_port] = "ipc", [splatbus.prefs.message_port] = "message" }
  if named[pinfo.dst_port] then return "client", named[pinfo.dst_port] end
  if named[pinfo.src_port] then return "server", named[pinfo.src_port] end
  return pinfo.match_uint == pinfo.dst_port and "client" or "server", nil -- by "Decode As"
end

-- One packet

local told = {} -- of the packets in a segment, for the info column

local function show(tree, range, message, members)
  local words = {}
  for _, each in ipairs(message.members) do
    local member = members[each.name]
    local text = member and member.text
    local number = text and tonumber(text)
    local value = unquoted(text)
    if number and each.kind == "int64" and number % 1 == 0 and math.abs(number) < 2^53 then
      value = Int64.new(number)
      text = string.format("%.0f", number)
    elseif each.kind == "double" then
      value = number
    elseif each.kind == "bool" then
      value = text == "true"
    elseif each.kind ~= "string" then
      value = nil
    end
    if value ~= nil and METAMODEL.fields[each.field] then
      local item = tree:add(fields["." .. each.field], range(member.first - 1, #member.text), value)
      if number and (number < (each.minimum or number) or number > (each.maximum or number)) then
        item:add_proto_expert_info(beyond, string.format(
          "%s is %s, beyond %s to %s (%s)", each.name, text,
          tostring(each.minimum or "any"), tostring(each.maximum or "any"), each.requirements))
      end
      if each.shown then
        words[#words + 1] = each.name .. " " .. (unquoted(text) or text)
      end
    end
  end
  return words
end

local function length_at(tvb, offset)
  local range = tvb(offset, METAMODEL.header)
  return METAMODEL.order == "little" and range:le_uint() or range:uint()
end

local function is_length(length)
  return length >= METAMODEL.least and length <= METAMODEL.most
end

local function packet(tvb, pinfo, root)
  local from, channel = ends(pinfo)
  local length = length_at(tvb, 0)
  local tree = root:add(splatbus, tvb())
  tree:add(fields.from, from):set_generated()
  if channel then tree:add(fields.channel, channel):set_generated() end
  local item = METAMODEL.order == "little"
    and tree:add_le(fields.length, tvb(0, METAMODEL.header))
    or tree:add(fields.length, tvb(0, METAMODEL.header))
  if not is_length(length) then
    local text = string.format("a length of %.0f, beyond %d to %d (%s)", length, METAMODEL.least,
      METAMODEL.most, METAMODEL.requirements)
    item:add_proto_expert_info(bad_length, text)
    told[#told + 1] = text
    return tvb:len()
  end
  local range = tvb(METAMODEL.header)
  local members = members_of(range:raw())
  if not members then
    tree:add_proto_expert_info(not_json)
    told[#told + 1] = "no object of JSON"
    return tvb:len()
  end
  local message, kind = meaning(members, from, channel)
  local name = message and message.name or kind or "without a type"
  item = tree:add(fields.message, name)
  item:set_generated()
  tree:append_text(", " .. name)
  local words = {}
  if message then
    words = show(tree, range, message, members)
  else
    item:add_proto_expert_info(unknown)
  end
  json:call(range:tvb(), pinfo, tree)
  told[#told + 1] = table.concat({ name, table.unpack(words) }, " ")
  return tvb:len()
end

local function size(tvb, _, offset)
  local length = length_at(tvb, offset)
  if length > METAMODEL.most then return tvb:len() - offset end
  return METAMODEL.header + length
end

function splatbus.dissector(tvb, pinfo, root)
  told = {}
  dissect_tcp_pdus(tvb, root, METAMODEL.header, size, packet)
  pinfo.cols.protocol = "SplatBus"
  if #told > 0 then pinfo.cols.info = table.concat(told, "; ") end
  return tvb:len()
end

-- Ports

local registered = {}

local function register()
  local tcp = DissectorTable.get("tcp.port")
  for _, port in ipairs(registered) do tcp:remove(port, splatbus) end
  registered = { splatbus.prefs.ipc_port, splatbus.prefs.message_port }
  for _, port in ipairs(registered) do tcp:add(port, splatbus) end
end

splatbus.prefs_changed = register
register()
