#include "daemon/doctor/dds_file.h"

#include <charconv>

namespace focalfleet::doctor {
namespace {

std::string WithoutComments(std::string_view xml) {
  std::string out;
  for (;;) {
    const std::size_t begin = xml.find("<!--");
    out += xml.substr(0, begin);
    if (begin == std::string_view::npos) return out;
    const std::size_t end = xml.find("-->", begin);
    if (end == std::string_view::npos) return out;
    xml.remove_prefix(end + 3);
  }
}

/// The inside of each tag `<name ...>`.
std::vector<std::string_view> Tags(std::string_view xml, std::string_view name) {
  std::vector<std::string_view> tags;
  const std::string opening = "<" + std::string(name);
  for (std::size_t at = xml.find(opening); at != std::string_view::npos;
       at = xml.find(opening, at + 1)) {
    const std::string_view rest = xml.substr(at + opening.size());
    if (rest.find_first_of(" \t\r\n/>") != 0) continue;  // a longer name
    tags.push_back(rest.substr(0, rest.find('>')));
  }
  return tags;
}

/// The value of an attribute; empty: the tag has none.
std::string Attribute(std::string_view tag, std::string_view name) {
  for (std::size_t at = tag.find(name); at != std::string_view::npos; at = tag.find(name, at + 1)) {
    const std::string_view rest = tag.substr(at + name.size());
    const bool whole = at > 0 && (tag[at - 1] == ' ' || tag[at - 1] == '\n' || tag[at - 1] == '\t');
    if (!whole || rest.size() < 2 || rest[0] != '=' || (rest[1] != '"' && rest[1] != '\''))
      continue;
    return std::string(rest.substr(2, rest.find(rest[1], 2) - 2));
  }
  return "";
}

/// The text of the first element of this name, without blanks around it.
std::string TextOf(std::string_view xml, std::string_view name) {
  const auto tags = Tags(xml, name);
  if (tags.empty()) return "";
  const auto begin = static_cast<std::size_t>(tags[0].data() - xml.data()) + tags[0].size() + 1;
  if (begin > xml.size()) return "";
  std::string_view text = xml.substr(begin);
  text = text.substr(0, text.find('<'));
  const std::size_t first = text.find_first_not_of(" \t\r\n");
  if (first == std::string_view::npos) return "";
  return std::string(text.substr(first, text.find_last_not_of(" \t\r\n") - first + 1));
}

/// A size with unit. Source: configuration guide of Cyclone DDS 0.10, kB is 2^10 bytes, MB 2^20.
std::optional<std::uint64_t> BytesOf(const std::string& text) {
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || value > (std::uint64_t{1} << 40)) return std::nullopt;
  const std::size_t after =
      text.find_first_not_of(' ', static_cast<std::size_t>(end - text.data()));
  const std::string unit = after == std::string::npos ? "" : text.substr(after);
  if (unit == "B") return value;
  if (unit == "kB" || unit == "KiB") return value << 10;
  if (unit == "MB" || unit == "MiB") return value << 20;
  if (unit == "GB" || unit == "GiB") return value << 30;
  return std::nullopt;
}

}  // namespace

DdsNeeds NeedsOf(std::string_view with_comments) {
  const std::string xml = WithoutComments(with_comments);
  DdsNeeds needs;
  for (const std::string_view tag : Tags(xml, "NetworkInterface")) {
    DdsInterface interface { Attribute(tag, "name"), Attribute(tag, "address") };
    if (Attribute(tag, "multicast") == "false") needs.multicast = false;
    if (!interface.name.empty() || !interface.address.empty())
      needs.interfaces.push_back(std::move(interface));
  }
  if (TextOf(xml, "AllowMulticast") == "false") needs.multicast = false;
  for (const std::string_view tag : Tags(xml, "SocketReceiveBufferSize")) {
    const auto most = BytesOf(Attribute(tag, "max"));
    needs.buffer_bytes = most ? most : BytesOf(Attribute(tag, "min"));
  }
  const std::string index = TextOf(xml, "MaxAutoParticipantIndex");
  std::uint32_t last = 0;
  if (std::from_chars(index.data(), index.data() + index.size(), last).ec == std::errc() &&
      last < 120)
    needs.participants = last + 1;
  return needs;
}

}  // namespace focalfleet::doctor
