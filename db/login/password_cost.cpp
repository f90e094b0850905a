// In its own file, so that a test program with its own definition does not link this one from the library.
#include "db/login/credentials.h"

namespace needlelab {

PasswordCost passwordCost() noexcept {
  return kPasswordCost;
}

}  // namespace needlelab
