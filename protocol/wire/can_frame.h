// A CAN 2.0B data frame with a 29-bit identifier. focalfleet sends and understands no other kind;
// ports drop and count all others.
#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace focalfleet {

struct CanFrame {
  std::uint32_t id = 0;     // 29 bits
  std::uint8_t length = 0;  // 0..8
  std::array<std::uint8_t, 8> data{};

  [[nodiscard]] constexpr std::span<const std::uint8_t> payload() const {
    return {data.data(), length};
  }
  constexpr bool operator==(const CanFrame&) const = default;
};

inline constexpr std::uint32_t kCanIdMax = (1u << 29) - 1;

}  // namespace focalfleet
