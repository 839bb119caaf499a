#include "daemon/cli/study_program.h"

int main(int argc, char** argv) { return focalfleet::cli::RunProgram(argc, argv); }
