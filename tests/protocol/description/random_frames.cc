// random_frames [COUNT [SEED]] prints random frames of every kind, and some spoilt ones. Each
// stands on a line with the codec's decoding of it, for other programs to be compared with.
//   08295287#FFFFFF0201003412 done node=42 sequence=81 outcome=7 ...
//   08295287#FFFFFF02010034 malformed length
#include <cstdio>
#include <cstdlib>
#include <string>
#include <type_traits>

#include "protocol/wire/codec.h"
#include "protocol/wire/layout.h"
#include "tests/protocol/random_messages.h"

namespace focalfleet {
namespace {

template <class T>
long long Plain(const T& value) {
  if constexpr (requires { value.value; })
    return static_cast<long long>(value.value);
  else
    return static_cast<long long>(value);
}

template <class Message>
std::string NameOf(const Message&) {
  return layout::Layout<Message>::kName;
}
std::string NameOf(const ParameterReply& m) {
  return m.written ? "parameter_write_reply" : "parameter_read_reply";
}

template <class Variant>
std::string Describe(const Addressed<Variant>& decoded) {
  return std::visit(
      [&](const auto& message) {
        std::string text = NameOf(message) + " node=" + std::to_string(decoded.address.node.value) +
                           " sequence=" + std::to_string(decoded.address.sequence);
        const auto add = [&](const auto& field) {
          text += std::string(" ") + field.row.name + "=" +
                  std::to_string(Plain(field.access(message)));
        };
        std::apply([&](const auto&... field) { (add(field), ...); },
                   layout::Layout<std::decay_t<decltype(message)>>::kFields);
        return text;
      },
      decoded.message);
}

void Spoil(Rng& rng, CanFrame* frame) {
  switch (rng.Below(3)) {
    case 0:
      frame->length = static_cast<std::uint8_t>(rng.Below(9));
      break;
    case 1:
      if (frame->length > 0) frame->data[rng.Below(frame->length)] ^= 0x80u;
      break;
    default:
      frame->id ^= 1u << rng.Below(3);
  }
}

void Print(const CanFrame& frame) {
  std::printf("%08X#", frame.id);
  for (const std::uint8_t byte : frame.payload()) std::printf("%02X", byte);
  const auto host = DecodeHost(frame);
  const auto unit = DecodeUnit(frame);
  if (host) {
    std::printf(" %s\n", Describe(*host).c_str());
  } else if (unit) {
    std::printf(" %s\n", Describe(*unit).c_str());
  } else {
    const bool from_unit = host.error() == Malformed::kDirection;
    std::printf(" malformed %s\n", Name(from_unit ? unit.error() : host.error()));
  }
}

int Main(int count, char** arguments) {
  const int frames = count > 1 ? std::atoi(arguments[1]) : 2000;
  Rng rng(count > 2 ? std::strtoull(arguments[2], nullptr, 10) : 1);
  for (int i = 0; i < frames; ++i) {
    const bool from_unit = rng.Below(2) != 0;
    const Address address{{static_cast<std::uint8_t>(rng.Below(128))},
                          static_cast<std::uint8_t>(rng.Below(256))};
    CanFrame frame =
        from_unit ? Encode(test::RandomUnit(rng), address) : Encode(test::RandomHost(rng), address);
    if (rng.Below(8) == 0) Spoil(rng, &frame);
    Print(frame);
  }
  return 0;
}

}  // namespace
}  // namespace focalfleet

int main(int count, char** arguments) { return focalfleet::Main(count, arguments); }
