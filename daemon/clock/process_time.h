// The CPU time that this process, or one of its threads, has taken so far.
#pragma once

#include <sys/resource.h>

namespace focalfleet {

/// In user and kernel mode, s. `who`: as of getrusage.
inline double CpuSecondsOf(int who) {
  rusage usage{};
  ::getrusage(who, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + static_cast<double>(t.tv_usec) * 1e-6;
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}
inline double ProcessCpuSeconds() { return CpuSecondsOf(RUSAGE_SELF); }
/// The same of the calling thread.
inline double ThreadCpuSeconds() { return CpuSecondsOf(RUSAGE_THREAD); }

}  // namespace focalfleet
