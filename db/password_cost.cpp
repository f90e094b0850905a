// Alone in its file: a test program with its own definition never links this one from the library.
#include "db/password_cost.h"

namespace needlelab {

PasswordCost passwordCost() noexcept {
  return kPasswordCost;
}

}  // namespace needlelab
