#include "daemon/study/study.h"

#include <malloc.h>

#include "daemon/study/program.h"

namespace focalfleet::cli {

void AddStudyCommands(CommandLine* line) {
  AddSimulateCommand(line);
  AddDiagnoseCommand(line);
  AddTuneCommand(line);
  AddReproduceCommand(line);
  AddHallCommands(line);
}

int RunStudy(int argc, char** argv) {
  // A diagnosis takes and frees megabytes thousands of times. The C library otherwise returns such
  // blocks to the kernel, which clears them again: a sixth of the CPU time.
  constexpr int kKept_bytes = 1 << 30;
  mallopt(M_MMAP_THRESHOLD, kKept_bytes);
  mallopt(M_TRIM_THRESHOLD, kKept_bytes);
  return Main(argc, argv, AddStudyCommands);
}

}  // namespace focalfleet::cli
