#include "daemon/soak/plant.h"

#include <algorithm>
#include <utility>

#include "daemon/ports/simulated_port.h"
#include "daemon/soak/virtual_time.h"
#include "fleet/hex_layout.h"
#include "fleet/targets.h"
#include "protocol/base/check.h"

namespace focalfleet::soak {
namespace {

constexpr std::uint32_t kSequenceBits = 0xffu << 3;
constexpr int kNodeShift = 11;
/// Far fewer than sequence numbers, of which no old one may be that of a new question.
constexpr std::size_t kAnswersOfUnit = 60;

}  // namespace

Plant::Plant(const Draws& draws) {
  HexPlate plate = MakeHexPlate({.count = draws.units,
                                 .units_per_bus = draws.units_per_bus,
                                 .units_per_rail = draws.units_per_bus * 2,
                                 .fiducials = draws.camera ? 12u : 0u});
  fiducials_ = std::move(plate.fiducials);
  auto layout = Layout::Create(std::move(plate.units), {});
  FOCALFLEET_CHECK(layout.has_value());
  layout_ = std::make_unique<Layout>(std::move(*layout));
  drives_.assign(layout_->size(), UnitDrive{});
  const auto first = DrawConfiguration(*layout_, drives_, {}, Rng::Stream(draws.seed, "start"));
  FOCALFLEET_CHECK(first.has_value());
  sim::WorldConfig config{.units = DescribeUnits(*layout_),
                          .seed = draws.seed,
                          .clock_error_max = draws.clock_error_max};
  for (std::uint32_t n = 0; n < layout_->size(); ++n)
    for (const Axis axis : kAxes)
      config.units[n].axis[Index(axis)].angle_deg =
          AngleDeg((*first)[n][Index(axis)], layout_->units()[n].axis[Index(axis)],
                   drives_[n].axis[Index(axis)]);
  config.start = HostInstant{ReadVirtualNs()};
  FOCALFLEET_CHECK(sim::World::Validate(config).has_value());
  world_ = std::make_unique<sim::World>(std::move(config));
  kernel_stamps_ = draws.kernel_stamps;
  remembers_ = draws.is(FaultSite::kOldAnswers);
  heard_.resize(layout_->buses().size());
}

void Plant::Advance(HostInstant now) {
  delivered_.clear();
  world_->AdvanceTo(now, &delivered_);
  const auto buses = layout_->buses();
  for (const ReceivedFrame& frame : delivered_) {
    const auto at = std::lower_bound(buses.begin(), buses.end(), frame.bus) - buses.begin();
    heard_[static_cast<std::size_t>(at)].push_back(frame);
    Remember(static_cast<std::size_t>(at), frame.frame);
  }
}

void Plant::Remember(std::size_t bus, const CanFrame& frame) {
  const bool asked = (frame.id & kSequenceBits) != 0;
  if (!remembers_ || !asked) return;
  std::deque<CanFrame>& answers = answers_[{bus, frame.id >> kNodeShift & 0xff}];
  answers.push_back(frame);
  if (answers.size() > kAnswersOfUnit) answers.pop_front();
}

std::optional<CanFrame> Plant::AnsweredBefore(std::size_t bus, const CanFrame& question) const {
  const auto unit = answers_.find({bus, question.id >> kNodeShift & 0xff});
  if (unit == answers_.end()) return std::nullopt;
  // Vectors and parameters have the axis as their detail, in question and answer.
  constexpr std::uint32_t kFunction = 0x3fu << 20, kAxis = 7u, kVector = 11, kParameter = 14;
  const std::uint32_t function = question.id >> 20 & 0x3f;
  const std::uint32_t what =
      function == kVector || function >= kParameter ? kFunction | kAxis : kFunction;
  for (auto answer = unit->second.rbegin(); answer != unit->second.rend(); ++answer) {
    const std::uint32_t apart = answer->id ^ question.id;
    if ((apart & what) == 0 && (apart & kSequenceBits) != 0) return *answer;
  }
  return std::nullopt;
}

void Plant::DropHeard() {
  for (auto& frames : heard_) frames.clear();
}

bool Plant::hears() const {
  return std::ranges::any_of(heard_, [](const auto& frames) { return !frames.empty(); });
}

struct PlantPort::Link {
  explicit Link(BusId bus) : state(bus) {}
  SimulatedLink state;
};

PlantPort::PlantPort(Plant* plant, std::size_t bus, Hooks hooks)
    : plant_(plant),
      index_(bus),
      bus_(plant->layout().buses()[bus]),
      hooks_(std::move(hooks)),
      name_("bus " + std::to_string(bus_.value)),
      link_(std::make_shared<Link>(bus_)) {}

std::size_t PlantPort::Send(std::span<const CanFrame> frames) {
  std::size_t taken = 0;
  for (const CanFrame& frame : frames) {
    if (hooks_.is_full()) return taken;
    hooks_.sends(bus_, frame);
    if (!plant_->world().Inject(bus_, frame, HostInstant{ReadVirtualNs()})) return taken;
    ++taken;
  }
  return taken;
}

void PlantPort::Receive(HostInstant now, std::vector<ReceivedFrame>* out) {
  auto& mine = *plant_->heard(index_);
  // The host may have been held up since a frame came.
  if (!plant_->kernel_stamps())
    for (ReceivedFrame& frame : mine) frame.at = now;
  out->insert(out->end(), mine.begin(), mine.end());
  mine.clear();
  link_->state.Look(plant_->world());
  counters_.link_errors = link_->state.errors();
}

LinkState PlantPort::state() const {
  return plant_->world().dead(bus_) ? LinkState::kDown : link_->state.state();
}

const std::string& PlantPort::trouble() const { return link_->state.trouble(); }

}  // namespace focalfleet::soak
