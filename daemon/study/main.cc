#include "daemon/study/program.h"

int main(int argc, char** argv) { return focalfleet::cli::RunStudy(argc, argv); }
