#include "protocol/wire/frame_bits.h"

namespace focalfleet {
namespace {

// CRC delimiter, ACK slot, ACK delimiter, end of frame, intermission.
constexpr std::uint32_t kUnstuffedTail = 1 + 1 + 1 + 7 + 3;

struct NoRecord {
  void Note(std::uint32_t, bool) {}
  void EndArbitration() {}
};

struct LevelRecord {
  void Note(std::uint32_t bit, bool stuff) {
    levels.recessive[levels.bits] = bit != 0;
    levels.stuff[levels.bits] = stuff;
    ++levels.bits;
  }
  void EndArbitration() { levels.arbitration = levels.bits; }
  FrameLevels levels;
};

// The walk goes through the stuffed part of a frame bit by bit. CRC and stuff bits grow as on the
// wire.
template <class Record>
class BitWalk {
 public:
  void Bits(std::uint32_t value, int count) {
    for (int i = count - 1; i >= 0; --i) Bit(value >> i & 1);
  }
  void Crc() {
    const std::uint32_t crc = crc_;
    for (int i = 14; i >= 0; --i) Stuff(crc >> i & 1);
  }
  /// A stuff bit is sent with the bit after it; no stuff bit follows the last bit before fixed
  /// stuffing.
  void DropLastStuffBit() {
    if (stuffed_last_) --bits_;
  }
  void EndArbitration() { record_.EndArbitration(); }
  [[nodiscard]] std::uint32_t bits() const { return bits_; }
  [[nodiscard]] const Record& record() const { return record_; }

 private:
  void Bit(std::uint32_t bit) {
    const std::uint32_t next = bit ^ (crc_ >> 14 & 1);
    crc_ = crc_ << 1 & 0x7fff;
    if (next != 0) crc_ ^= 0x4599;
    Stuff(bit);
  }
  void Stuff(std::uint32_t bit) {
    ++bits_;
    record_.Note(bit, false);
    run_ = bit == last_ ? run_ + 1 : 1;
    last_ = bit;
    stuffed_last_ = run_ == 5;
    if (stuffed_last_) {
      ++bits_;
      record_.Note(bit ^ 1, true);
      last_ = bit ^ 1;
      run_ = 1;
    }
  }

  std::uint32_t crc_ = 0;
  std::uint32_t bits_ = 0;
  std::uint32_t last_ = 2;  // neither 0 nor 1: the first bit starts a run
  int run_ = 0;
  bool stuffed_last_ = false;
  Record record_;
};

template <class Record = NoRecord>
BitWalk<Record> Walk(const CanFrame& frame) {
  BitWalk<Record> walk;
  walk.Bits(0, 1);                    // start of frame
  walk.Bits(frame.id >> 18, 11);      // base identifier
  walk.Bits(0b11, 2);                 // SRR, IDE: recessive
  walk.Bits(frame.id & 0x3ffff, 18);  // identifier extension
  walk.Bits(0, 1);                    // RTR
  walk.EndArbitration();
  walk.Bits(0, 2);  // r1, r0
  walk.Bits(frame.length, 4);
  for (const std::uint8_t byte : frame.payload()) walk.Bits(byte, 8);
  return walk;
}

}  // namespace

std::uint32_t FrameBits(const CanFrame& frame) {
  BitWalk walk = Walk(frame);
  walk.Crc();
  return walk.bits() + kUnstuffedTail;
}

FdFrameBits FrameBits(const FdFrame& frame) {
  BitWalk<NoRecord> walk;
  walk.Bits(0, 1);                    // start of frame
  walk.Bits(frame.id >> 18, 11);      // base identifier
  walk.Bits(0b11, 2);                 // SRR, IDE
  walk.Bits(frame.id & 0x3ffff, 18);  // identifier extension
  walk.Bits(0b0101, 4);               // RRS, FDF, res, BRS
  const std::uint32_t before_switch = walk.bits();
  walk.Bits(0, 1);  // ESI: error active
  walk.Bits(FdLengthCode(frame.length), 4);
  for (const std::uint8_t byte : frame.payload()) walk.Bits(byte, 8);
  walk.DropLastStuffBit();  // the fixed one comes in its place
  const std::uint32_t check_bits = 4 + (frame.length > 16 ? 21 : 17);
  const std::uint32_t fixed_stuff_bits = 1 + (check_bits - 1) / 4;
  return {.nominal = before_switch + kUnstuffedTail - 1,
          .data = walk.bits() - before_switch + check_bits + fixed_stuff_bits + 1};
}

OnWire NextOnWire(std::span<const CanFrame> frames, const BusRates& rates) {
  if (rates.data_bps > 0) {
    FdFrame group;
    const std::size_t grouped = PackGroup(frames, &group);
    if (grouped >= kGroupEntriesMin) return {grouped, NominalBits(FrameBits(group), rates)};
  }
  return {1, FrameBits(frames.front())};
}

std::uint64_t BitsOnWire(std::span<const CanFrame> frames, const BusRates& rates) {
  std::uint64_t bits = 0;
  while (!frames.empty()) {
    const OnWire next = NextOnWire(frames, rates);
    bits += next.bits;
    frames = frames.subspan(next.frames);
  }
  return bits;
}

FrameLevels LevelsOf(const CanFrame& frame) {
  auto walk = Walk<LevelRecord>(frame);
  walk.Crc();
  return walk.record().levels;
}

}  // namespace focalfleet
