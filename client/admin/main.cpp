#include <iostream>

#include "client/admin/app.h"
#include "common/base/secret.h"
#include "common/wire/protobuf_log.h"

int main(int argc, char** argv) {
  needlelab::keepOutOfCoreDumps();
  needlelab::keepProtobufQuiet();
  return needlelab::runAdmin(argc, argv, std::cout, std::cerr);
}
