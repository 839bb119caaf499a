#include "daemon/page/plate_frame.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <utility>

namespace focalfleet {
namespace {

static_assert(std::endian::native == std::endian::little, "numbers are copied as they are");

constexpr std::size_t kHeadBytes = 40;  // behind the length
constexpr std::uint8_t kFormat = 1;
constexpr std::size_t kWholeBytes = 14;
constexpr std::size_t kAnglesBytes = 4;
static_assert(sizeof(PlateUnit) == kWholeBytes);
/// A frame is never longer; one of 100,000 units has 1.4 MB.
constexpr std::uint32_t kFrameBytesMax = 64u << 20;

template <class Number>
void Put(Number value, std::string* out) {
  char bytes[sizeof value];
  std::memcpy(bytes, &value, sizeof value);
  out->append(bytes, sizeof value);
}

double Milliseconds1970(WallTime at) { return static_cast<double>(at.ns) / 1e6; }

/// The bytes of the units that `belongs` names, behind their bits.
template <class Belongs>
void PutGroup(std::span<const PlateUnit> units, std::size_t count, std::size_t bytes_each,
              Belongs belongs, std::string* out) {
  if (count == 0) return;
  if (count < units.size()) {
    const std::size_t at = out->size();
    out->append((units.size() + 7) / 8, '\0');
    for (std::size_t i = 0; i < units.size(); ++i)
      if (belongs(i)) (*out)[at + i / 8] = static_cast<char>((*out)[at + i / 8] | (1 << (i % 8)));
  }
  for (std::size_t i = 0; i < units.size(); ++i) {
    if (!belongs(i)) continue;
    char bytes[kWholeBytes];
    std::memcpy(bytes, &units[i], kWholeBytes);
    out->append(bytes, bytes_each);
  }
}

enum class Change : std::uint8_t { kNone, kAngles, kWhole };

Change ChangeOf(const PlateUnit& before, const PlateUnit& now) {
  if (before == now) return Change::kNone;
  PlateUnit turned = before;
  turned.theta = now.theta;
  turned.phi = now.phi;
  return turned == now ? Change::kAngles : Change::kWhole;
}

std::string Encode(const PlateFrameHead& head, std::span<const PlateUnit> units,
                   const std::vector<Change>& changes) {
  const auto count = [&](Change which) {
    return static_cast<std::size_t>(std::ranges::count(changes, which));
  };
  const std::size_t whole = count(Change::kWhole);
  const std::size_t angles = count(Change::kAngles);
  std::string out;
  out.reserve(4 + kHeadBytes + head.facts.size() + units.size() / 4 + whole * kWholeBytes +
              angles * kAnglesBytes + 2);
  Put(std::uint32_t{0}, &out);
  Put(static_cast<std::uint8_t>(head.kind), &out);
  Put(kFormat, &out);
  Put(std::uint16_t{0}, &out);
  Put(head.number, &out);
  Put(Milliseconds1970(head.made), &out);
  Put(Milliseconds1970(head.status), &out);
  Put(static_cast<std::uint32_t>(units.size()), &out);
  Put(static_cast<std::uint32_t>(head.facts.size()), &out);
  Put(static_cast<std::uint32_t>(whole), &out);
  Put(static_cast<std::uint32_t>(angles), &out);
  out += head.facts;
  PutGroup(
      units, whole, kWholeBytes, [&](std::size_t i) { return changes[i] == Change::kWhole; }, &out);
  PutGroup(
      units, angles, kAnglesBytes, [&](std::size_t i) { return changes[i] == Change::kAngles; },
      &out);
  const auto length = static_cast<std::uint32_t>(out.size() - 4);
  std::memcpy(out.data(), &length, sizeof length);
  return out;
}

/// Reads numbers from the front of some bytes.
class Bytes {
 public:
  explicit Bytes(std::string_view bytes) : rest_(bytes) {}
  template <class Number>
  Number Take() {
    Number value{};
    if (rest_.size() < sizeof value) {
      short_ = true;
      return value;
    }
    std::memcpy(&value, rest_.data(), sizeof value);
    rest_.remove_prefix(sizeof value);
    return value;
  }
  std::string_view Take(std::size_t count) {
    short_ = short_ || rest_.size() < count;
    const std::string_view taken = rest_.substr(0, count);
    rest_.remove_prefix(std::min(count, rest_.size()));
    return taken;
  }
  [[nodiscard]] bool fits() const { return !short_; }
  [[nodiscard]] bool empty() const { return rest_.empty(); }

 private:
  std::string_view rest_;
  bool short_ = false;
};

Status TakeGroup(std::size_t count, std::size_t bytes_each, Bytes* bytes,
                 std::vector<PlateUnit>* units) {
  if (count == 0) return {};
  const bool all = count == units->size();
  const std::string_view bits = all ? "" : bytes->Take((units->size() + 7) / 8);
  const std::string_view values = bytes->Take(count * bytes_each);
  if (!bytes->fits()) return Fail(ErrorCode::kInvalid, "the frame is too short");
  std::size_t taken = 0;
  for (std::size_t i = 0; i < units->size(); ++i) {
    const auto byte = all ? 0xFFu : static_cast<unsigned char>(bits[i / 8]);
    if (((byte >> (i % 8)) & 1u) == 0) continue;
    if (taken == count) return Fail(ErrorCode::kInvalid, "the frame has more bits than units");
    std::memcpy(&(*units)[i], values.data() + taken * bytes_each, bytes_each);
    ++taken;
  }
  if (taken != count) return Fail(ErrorCode::kInvalid, "the frame has fewer bits than units");
  return {};
}

WallTime InstantOfMs(double ms) { return {static_cast<std::int64_t>(ms * 1e6)}; }

}  // namespace

std::string EncodeSnapshot(const PlateFrameHead& head, std::span<const PlateUnit> units) {
  return Encode(head, units, std::vector<Change>(units.size(), Change::kWhole));
}

std::string EncodeDelta(const PlateFrameHead& head, std::span<const PlateUnit> before,
                        std::span<const PlateUnit> units) {
  std::vector<Change> changes(units.size());
  for (std::size_t i = 0; i < units.size(); ++i) changes[i] = ChangeOf(before[i], units[i]);
  return Encode(head, units, changes);
}

Result<PlateFrameHead> DecodeFrame(std::string_view frame, std::vector<PlateUnit>* units) {
  Bytes bytes(frame);
  const auto length = bytes.Take<std::uint32_t>();
  PlateFrameHead head;
  head.kind = static_cast<PlateFrameKind>(bytes.Take<std::uint8_t>());
  const auto format = bytes.Take<std::uint8_t>();
  bytes.Take<std::uint16_t>();
  head.number = bytes.Take<std::uint32_t>();
  head.made = InstantOfMs(bytes.Take<double>());
  head.status = InstantOfMs(bytes.Take<double>());
  const auto count = bytes.Take<std::uint32_t>();
  const auto facts = bytes.Take<std::uint32_t>();
  const auto whole = bytes.Take<std::uint32_t>();
  const auto angles = bytes.Take<std::uint32_t>();
  if (!bytes.fits() || format != kFormat || length != frame.size() - 4 || length > kFrameBytesMax)
    return Fail(ErrorCode::kInvalid, "these bytes are no frame of a plate");
  const bool snapshot = head.kind == PlateFrameKind::kSnapshot;
  if (!snapshot && (head.kind != PlateFrameKind::kDelta || units->size() != count))
    return Fail(ErrorCode::kInvalid, "the frame does not go onto these units");
  if (whole > count || angles > count || (snapshot && whole != count) ||
      std::size_t{whole} * kWholeBytes > length)
    return Fail(ErrorCode::kInvalid, "the frame has other units");
  if (snapshot) units->assign(count, {});
  head.facts = bytes.Take(facts);
  FOCALFLEET_TRY(TakeGroup(whole, kWholeBytes, &bytes, units));
  FOCALFLEET_TRY(TakeGroup(angles, kAnglesBytes, &bytes, units));
  if (!bytes.fits() || !bytes.empty())
    return Fail(ErrorCode::kInvalid, "the frame has another length");
  return head;
}

PlateEncoder::PlateEncoder(std::size_t units, Options options) : options_(options), sent_(units) {}

std::string PlateEncoder::Next(const PlateTable& table, WallTime now) {
  // Wall time may step back: what seems to lie ahead is due.
  const auto is_due = [&](WallTime last, std::int64_t period_ns) {
    return now.ns - last.ns >= period_ns || now < last;
  };
  const bool facts_due = number_ == 0 || table.urgent() != urgent_ ||
                         (table.at() != status_ && is_due(facts_at_, options_.facts_period_ns));
  const bool changed = table.units() != sent_;
  if (!facts_due && !changed && !is_due(last_at_, options_.heartbeat_period_ns)) return {};
  PlateFrameHead head{
      .kind = PlateFrameKind::kDelta, .number = ++number_, .made = now, .status = table.at()};
  if (facts_due) {
    facts_ = table.Facts();
    head.facts = facts_;
    facts_at_ = now;
    urgent_ = table.urgent();
  }
  std::string frame = EncodeDelta(head, sent_, table.units());
  sent_ = table.units();
  status_ = table.at();
  last_at_ = now;
  return frame;
}

std::string PlateEncoder::Snapshot(WallTime now) const {
  return EncodeSnapshot({.kind = PlateFrameKind::kSnapshot,
                         .number = number_,
                         .made = now,
                         .status = status_,
                         .facts = facts_},
                        sent_);
}

}  // namespace focalfleet
