// The wall is stable in every hard case; the other files have each case's further checks and its controls.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/stability/case_rows.h"

namespace needlelab::test {
namespace {

class EveryCase : public testing::TestWithParam<std::string> {};
TEST_P(EveryCase, theWallIsStable) {
  EXPECT_TRUE(isStable(rowOf(GetParam())));
}
INSTANTIATE_TEST_SUITE_P(
    Stability, EveryCase,
    [] {
      std::vector<std::string> names;
      for (const StabilityCase& one : allCases())
        if (one.name != "random_energy") names.push_back(one.name);  // slow: RandomEnergy runs it
      return testing::ValuesIn(names);
    }(),
    [](const auto& test) { return test.param; });

}  // namespace
}  // namespace needlelab::test
