#include "client/sim/command.h"

int main(int argc, char** argv) {
  return needlelab::runSim(argc, argv);
}
