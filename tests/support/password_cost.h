/// For test programs that link password_cost.cpp: hashing a password costs next to nothing there.
#pragma once

namespace needlelab::test {

/// During its lifetime hashing costs what it costs in programs for users. At most one at a time.
class ProductPasswordCost {
 public:
  ProductPasswordCost() noexcept;
  ~ProductPasswordCost();
  ProductPasswordCost(const ProductPasswordCost&) = delete;
  ProductPasswordCost& operator=(const ProductPasswordCost&) = delete;
};

}  // namespace needlelab::test
