// The guard counts uses of the heap during a scope. Programs that link this library have their
// global operator new replaced. Every allocation of C++ code on this thread counts, whatever
// library makes it.
#pragma once

#include <cstdint>

namespace focalfleet::test {

/// Allocations by operator new on this thread since the thread began.
std::uint64_t AllocationCount();

/// The guard counts from its construction on: `EXPECT_EQ(guard.allocations(), 0u)`.
class AllocGuard {
 public:
  AllocGuard() : before_(AllocationCount()) {}
  [[nodiscard]] std::uint64_t allocations() const { return AllocationCount() - before_; }

 private:
  std::uint64_t before_;
};

}  // namespace focalfleet::test
