#include "daemon/study/study.h"

#include "daemon/study/program.h"

namespace focalfleet::cli {

void AddStudyCommands(CommandLine* line) {
  AddSimulateCommand(line);
  AddDiagnoseCommand(line);
  AddTuneCommand(line);
  AddReproduceCommand(line);
  AddHallCommands(line);
}

int RunStudy(int argc, char** argv) { return Main(argc, argv, AddStudyCommands); }

}  // namespace focalfleet::cli
