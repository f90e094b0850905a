#include "common/wire/version.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace needlelab {
namespace {

pb::Version version(std::uint32_t major, std::uint32_t minor) {
  pb::Version v;
  v.set_major(major);
  v.set_minor(minor);
  return v;
}

TEST(Version, sameMajorSpeaksTogetherWhateverTheMinor) {
  EXPECT_TRUE(checkVersion(version(1, 0), version(1, 7)).ok());
  EXPECT_TRUE(checkVersion(version(1, 7), version(1, 0)).ok());
}

TEST(Version, anotherMajorIsRefusedAndBothAreNamed) {
  const auto status = checkVersion(version(1, 3), version(2, 5));
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().code, ErrorCode::kVersion);
  EXPECT_THAT(status.error().message, testing::AllOf(testing::HasSubstr("1.3"), testing::HasSubstr("2.5")));
}

TEST(Version, noVersionIsMajorZeroAndRefused) {
  EXPECT_FALSE(checkVersion(ourVersion(), pb::Version{}).ok());
}

}  // namespace
}  // namespace needlelab
