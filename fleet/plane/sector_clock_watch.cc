#include "fleet/plane/sector_clock_watch.h"

#include <algorithm>
#include <string>

namespace focalfleet {

void SectorClockWatch::Look(const SectorBook& sectors, HostInstant now,
                            std::vector<ShellNote>* notes) {
  const auto reported = [](const auto& one) { return one.second.reported; };
  const bool was_open = std::ranges::any_of(loose_, reported);
  std::erase_if(loose_, [&](const auto& one) { return !sectors.HasLooseClock(one.first); });
  bool more = false;
  for (std::uint32_t sector = 0; sector < sectors.size(); ++sector) {
    if (!sectors.HasLooseClock(sector)) continue;
    Loose& loose = loose_.try_emplace(sector, Loose{now}).first->second;
    if (loose.reported || now < loose.since + patience_) continue;
    loose.reported = more = true;
  }
  if (more) {
    std::string text;
    for (const auto& [sector, loose] : loose_) {
      if (!loose.reported) continue;
      text += (text.empty() ? "" : "; ") + NameOfSector(sector) + " " + sectors[sector].trouble;
    }
    notes->push_back({AlarmName::kSectorClockLoose, text + ": no part in rounds"});
  } else if (was_open && std::ranges::none_of(loose_, reported)) {
    notes->push_back({AlarmName::kSectorClocksGood,
                      "no sector that follows this coordinator has a loose clock any more",
                      AlarmName::kSectorClockLoose});
  }
}

}  // namespace focalfleet
