/// For test programs that link password_cost.cpp: hashing a password costs next to nothing there, and a test
/// sees its checks.
#pragma once

#include <vector>

#include "db/login/credentials.h"

namespace needlelab::test {

/// During its lifetime hashing costs the same as in programs for users. At most one at a time.
class ProductPasswordCost {
 public:
  ProductPasswordCost() noexcept;
  ~ProductPasswordCost();
  ProductPasswordCost(const ProductPasswordCost&) = delete;
  ProductPasswordCost& operator=(const ProductPasswordCost&) = delete;
};

/// The checks of passwords and codes in this program since its construction. At most one at a time. Thread:
/// any.
class PasswordChecks {
 public:
  enum class Gate { kOpen, kClosed };

  /// With a closed gate each check waits before it begins.
  explicit PasswordChecks(Gate gate = Gate::kOpen);
  /// Opens the gate.
  ~PasswordChecks();
  PasswordChecks(const PasswordChecks&) = delete;
  PasswordChecks& operator=(const PasswordChecks&) = delete;

  /// The cost of each check so far.
  [[nodiscard]] std::vector<PasswordCost> all() const;
  /// Waits for the first one. Returns false after kPatience.
  [[nodiscard]] bool waitForOne() const;
  void openGate();
};

}  // namespace needlelab::test
