#include "daemon/simulator/command_line.h"

int main(int argc, char** argv) { return focalfleet::simulator::Main(argc, argv); }
