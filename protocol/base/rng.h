// Chance is an argument. The generator is xoshiro256** seeded by splitmix64. The distributions are
// written here, because the standard ones differ between libraries and the same seed must give the
// same bits. Sub-streams are keyed by (seed, purpose, index), so that a new draw in one place does
// not shift the others.
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <string_view>

namespace focalfleet {

class Rng {
 public:
  explicit constexpr Rng(std::uint64_t seed) {
    for (auto& word : state_) word = SplitMix(seed);
  }

  /// An independent stream for one purpose and one index (a unit, a bus, a campaign).
  static constexpr Rng Stream(std::uint64_t seed, std::string_view purpose,
                              std::uint64_t index = 0) {
    std::uint64_t hash = 0xcbf29ce484222325u;  // FNV-1a of the purpose
    for (const char c : purpose) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3u;
    std::uint64_t mixed = seed;
    mixed = SplitMix(mixed) ^ hash;
    mixed = SplitMix(mixed) ^ index;
    return Rng(SplitMix(mixed));
  }

  constexpr std::uint64_t Bits() {
    const std::uint64_t result = std::rotl(state_[1] * 5, 7) * 9;
    const std::uint64_t t = state_[1] << 17;
    state_[2] ^= state_[0];
    state_[3] ^= state_[1];
    state_[1] ^= state_[2];
    state_[0] ^= state_[3];
    state_[2] ^= t;
    state_[3] = std::rotl(state_[3], 45);
    return result;
  }

  /// Uniform in [0, 1), 53 bits.
  constexpr double Uniform() { return static_cast<double>(Bits() >> 11) * 0x1.0p-53; }
  constexpr double Uniform(double low, double high) { return low + (high - low) * Uniform(); }

  /// Uniform in 0..n-1, n > 0, without modulo bias (Lemire's rejection).
  constexpr std::uint64_t Below(std::uint64_t n) {
    const std::uint64_t threshold = (0 - n) % n;
    for (;;) {
      const std::uint64_t bits = Bits();
      if (bits >= threshold) return bits % n;
    }
  }

  /// A standard normal draw (Marsaglia's polar method). No second value is cached, so that a draw
  /// has no hidden state.
  double Normal() {
    for (;;) {
      const double u = Uniform(-1, 1);
      const double v = Uniform(-1, 1);
      const double s = u * u + v * v;
      if (s > 0 && s < 1) return u * std::sqrt(-2 * std::log(s) / s);
    }
  }

 private:
  static constexpr std::uint64_t SplitMix(std::uint64_t& x) {
    x += 0x9e3779b97f4a7c15u;
    std::uint64_t z = x;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
  }

  std::array<std::uint64_t, 4> state_{};
};

}  // namespace focalfleet
