// For test programs: the lowest cost that libsodium accepts, and a record of each check. It is in the
// program's own sources, so that it overrides the library's version (db/login/password_cost.cpp) and
// libsodium's crypto_pwhash.
#include "tests/support/store/password_cost.h"

#include <sodium.h>

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <utility>

#include "tests/support/patience.h"

namespace needlelab {
namespace {

std::atomic<bool> as_in_the_product{false};

struct Checks {
  std::mutex mutex;
  std::condition_variable changed;
  bool watched = false, gate_closed = false;
  std::vector<PasswordCost> all;
};
Checks& checks() {
  static Checks made;
  return made;
}

void noteCheck(const PasswordCost& work) {
  std::unique_lock lock(checks().mutex);
  if (!checks().watched) return;
  checks().all.push_back(work);
  checks().changed.notify_all();
  checks().changed.wait(lock, [] { return !checks().gate_closed; });
}

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

PasswordChecks::PasswordChecks(Gate gate) {
  const std::scoped_lock lock(checks().mutex);
  checks().watched = true;
  checks().gate_closed = gate == Gate::kClosed;
  checks().all.clear();
}

PasswordChecks::~PasswordChecks() {
  openGate();
  const std::scoped_lock lock(checks().mutex);
  checks().watched = false;
}

std::vector<PasswordCost> PasswordChecks::all() const {
  const std::scoped_lock lock(checks().mutex);
  return checks().all;
}

bool PasswordChecks::waitForOne() const {
  std::unique_lock lock(checks().mutex);
  return checks().changed.wait_for(lock, kPatience, [] { return !checks().all.empty(); });
}

void PasswordChecks::openGate() {
  const std::scoped_lock lock(checks().mutex);
  checks().gate_closed = false;
  checks().changed.notify_all();
}

}  // namespace test
}  // namespace needlelab

/// db/login/credentials.cpp calls it only to check a password or code.
extern "C" int crypto_pwhash(unsigned char* const out, unsigned long long out_bytes, const char* const secret,
                             unsigned long long secret_bytes, const unsigned char* const salt,
                             unsigned long long operations, std::size_t memory_bytes, int algorithm) {
  needlelab::noteCheck({operations, memory_bytes});
  // what libsodium's own function does for argon2id
  return crypto_pwhash_argon2id(out, out_bytes, secret, secret_bytes, salt, operations, memory_bytes,
                                algorithm);
}
