#include <iostream>

#include "client/admin/command.h"
#include "common/base/program.h"
#include "common/base/secret.h"
#include "common/wire/protocol.h"

int main(int argc, char** argv) {
  needlelab::keepOutOfCoreDumps();
  needlelab::keepProtobufQuiet();
  return needlelab::afterOutput(needlelab::runAdmin(argc, argv, std::cout, std::cerr), "needlelab-admin");
}
