#include "common/base/formatted.h"

#include <gtest/gtest.h>

namespace needlelab {
namespace {

TEST(Formatted, saysNumbersAsPrintfDoes) {
  EXPECT_EQ(formatted("%d of %.2f N, %s", 3, 1.5, "held"), "3 of 1.50 N, held");
  EXPECT_EQ(formatted("%s", ""), "");
}

TEST(Formatted, cutsNothingOff) {
  const std::string longer(5000, 'x');
  EXPECT_EQ(formatted("<%s>", longer.c_str()), "<" + longer + ">");
}

}  // namespace
}  // namespace needlelab
