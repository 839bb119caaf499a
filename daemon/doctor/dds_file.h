// Needs of a configuration of Cyclone DDS, as far as the machine can fail them. The text is
// searched for the few elements that matter here; Cyclone itself checks the whole file.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace focalfleet::doctor {

struct DdsInterface {
  std::string name;     // as `ip link` shows it; empty: given by its address
  std::string address;  // empty: given by its name
};

struct DdsNeeds {
  std::vector<DdsInterface> interfaces;       // empty: Cyclone takes one
  bool multicast = true;                      // it may be used
  std::optional<std::uint64_t> buffer_bytes;  // of a receive socket, the most that is asked for
  std::uint32_t participants =
      10;  // most on this host; Cyclone 0.10 allows index 0 to 9 by default
};

/// Text that is no such file gives the defaults.
DdsNeeds NeedsOf(std::string_view xml);

}  // namespace focalfleet::doctor
