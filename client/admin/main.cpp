#include <iostream>

#include "admin/app.h"

int main(int argc, char** argv) {
  return needlelab::runAdmin(argc, argv, std::cout, std::cerr);
}
