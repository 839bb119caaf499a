// The seed of a random test. Every failure inside its scope prints the seed, and the environment
// variable repeats it: FOCALFLEET_SEED=4711 ctest -R Codec.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <cstdlib>
#include <string>

namespace focalfleet::test {

inline std::uint64_t TestSeed(std::uint64_t otherwise) {
  const char* text = std::getenv("FOCALFLEET_SEED");
  return text == nullptr ? otherwise : std::strtoull(text, nullptr, 10);
}

}  // namespace focalfleet::test

#define FOCALFLEET_TRACE_SEED(seed) SCOPED_TRACE("FOCALFLEET_SEED=" + std::to_string(seed))
