#include "daemon/http/host_header.h"

#include <algorithm>
#include <array>
#include <cctype>

namespace focalfleet {
namespace {

constexpr std::array<std::string_view, 3> kLoopback = {"localhost", "127.0.0.1", "::1"};

bool AreDigits(std::string_view text) {
  return std::ranges::all_of(text, [](unsigned char c) { return std::isdigit(c) != 0; });
}

bool AreAlike(std::string_view a, std::string_view b) {
  return std::ranges::equal(
      a, b, [](unsigned char x, unsigned char y) { return std::tolower(x) == std::tolower(y); });
}

/// The name or address without port and brackets; empty where the text is neither.
std::string_view NameOf(std::string_view host) {
  const bool bracketed = host.starts_with('[');
  const std::size_t end = bracketed ? host.find(']') : host.find(':');
  if (bracketed && end == std::string_view::npos) return {};
  const std::string_view name = host.substr(bracketed ? 1 : 0, bracketed ? end - 1 : end);
  std::string_view port = end == std::string_view::npos ? "" : host.substr(end + bracketed);
  if (port.empty()) return name;
  port.remove_prefix(1);
  return host[end + bracketed] == ':' && AreDigits(port) ? name : std::string_view();
}

}  // namespace

bool IsAllowedHost(std::string_view host, const std::vector<std::string>& names) {
  const std::string_view name = NameOf(host);
  if (name.empty()) return false;
  const auto is_name = [&](std::string_view other) { return AreAlike(name, other); };
  return std::ranges::any_of(kLoopback, is_name) || std::ranges::any_of(names, is_name);
}

}  // namespace focalfleet
