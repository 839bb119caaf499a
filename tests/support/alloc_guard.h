// Forbids the heap for the length of a scope. The programs that link this replace the global
// operator new, so every allocation of C++ code on this thread counts, whatever library makes it.
#pragma once

#include <cstdint>

namespace focalfleet::test {

/// Allocations by operator new on this thread since it began.
std::uint64_t AllocationCount();

/// Counts from its construction on: `EXPECT_EQ(guard.allocations(), 0u)`.
class AllocGuard {
 public:
  AllocGuard() : before_(AllocationCount()) {}
  [[nodiscard]] std::uint64_t allocations() const { return AllocationCount() - before_; }

 private:
  std::uint64_t before_;
};

}  // namespace focalfleet::test
