#include "daemon/process/program.h"

int main(int argc, char** argv) { return focalfleet::RunFocalfleetd(argc, argv); }
