// Eight directions at a time, number by number, so that a loop over them becomes vector
// instructions of whatever width the machine has: GCC compiles the functions marked
// FOCALFLEET_WIDE twice and the loader picks one. Both do the same operations in the same order,
// without fused ones, so the same bits come out.
#pragma once

#include <array>
#include <cstddef>

namespace focalfleet::sim {

// Sanitizers and coverage instrument the resolver that picks, which runs before they do.
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
/// Field and its change with the direction, as FieldSample.
struct SampleLanes {
  Lane b_T, slope_x, slope_y, slope_z;
};

}  // namespace focalfleet::sim
