// Eight directions at a time, number by number, so that a loop over them becomes vector
// instructions of the machine's width. GCC compiles the functions marked FOCALFLEET_WIDE twice and
// the loader picks one. Both do the same operations in the same order, without fused ones, so the
// results have the same bits.
#pragma once

#include <array>
#include <cstddef>

namespace focalfleet::sim {

// Sanitizers and coverage would instrument the resolver that picks, which runs before their own
// start.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && defined(__OPTIMIZE__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define FOCALFLEET_WIDE __attribute__((target_clones("avx2", "default")))
#else
#define FOCALFLEET_WIDE
#endif

inline constexpr std::size_t kLanes = 8;

struct alignas(64) Lane {
  double at[kLanes];
};
struct DirectionLanes {
  Lane x, y, z;
};
/// The field and its change with the direction, as in FieldSample.
struct SampleLanes {
  Lane b_T, slope_x, slope_y, slope_z;
};

}  // namespace focalfleet::sim
