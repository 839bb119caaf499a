// The CPU time that this process has taken so far.
#pragma once

#include <sys/resource.h>

namespace focalfleet {

/// In user and kernel mode, over all threads, s.
inline double ProcessCpuSeconds() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + static_cast<double>(t.tv_usec) * 1e-6;
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

}  // namespace focalfleet
