#include <iostream>

#include "admin/app.h"
#include "base/secret.h"
#include "wire/protobuf_log.h"

int main(int argc, char** argv) {
  needlelab::keepOutOfCoreDumps();
  needlelab::keepProtobufQuiet();
  return needlelab::runAdmin(argc, argv, std::cout, std::cerr);
}
