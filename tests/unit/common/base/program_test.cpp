#include "common/base/program.h"

#include <gmock/gmock.h>

namespace needlelab {
namespace {

TEST(MachineText, namesCoresAndSystemOnOneLine) {
  const std::string text = machineText();
  EXPECT_THAT(text, testing::HasSubstr("Linux "));
  EXPECT_THAT(text, testing::ContainsRegex(", [0-9]+ cores, "));
  EXPECT_EQ(text.find('\n'), std::string::npos);
}

}  // namespace
}  // namespace needlelab
