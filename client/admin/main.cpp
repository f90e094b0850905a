#include <iostream>

#include "admin/app.h"
#include "base/secret.h"

int main(int argc, char** argv) {
  needlelab::keepOutOfCoreDumps();
  return needlelab::runAdmin(argc, argv, std::cout, std::cerr);
}
