// For test programs: the least cost that libsodium takes. It is in the program's own sources, so that it
// overrides the library's version (db/password_cost.cpp).
#include "tests/support/password_cost.h"

#include <sodium.h>

#include <atomic>

#include "db/password_cost.h"

namespace needlelab {
namespace {

std::atomic<bool> as_in_the_product{false};

}  // namespace

PasswordCost passwordCost() noexcept {
  if (as_in_the_product) return kPasswordCost;
  return {crypto_pwhash_OPSLIMIT_MIN, crypto_pwhash_MEMLIMIT_MIN};
}

namespace test {

ProductPasswordCost::ProductPasswordCost() noexcept {
  as_in_the_product = true;
}

ProductPasswordCost::~ProductPasswordCost() {
  as_in_the_product = false;
}

}  // namespace test
}  // namespace needlelab
