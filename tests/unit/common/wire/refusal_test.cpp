#include "common/wire/refusal.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace needlelab {
namespace {

TEST(Refusal, theReasonDecidesWhetherTryingAgainMayHelp) {
  EXPECT_EQ(errorOf(makeRefusal(pb::Refusal::SHUTTING_DOWN, "")).code, ErrorCode::kUnavailable);
  EXPECT_EQ(errorOf(makeRefusal(pb::Refusal::RATE_LIMITED, "")).code, ErrorCode::kUnavailable);
  EXPECT_EQ(errorOf(makeRefusal(pb::Refusal::LOGIN, "")).code, ErrorCode::kDenied);
  EXPECT_EQ(errorOf(makeRefusal(pb::Refusal::VERSION, "")).code, ErrorCode::kVersion);
}

TEST(Refusal, aVersionRefusalNamesBothVersions) {
  auto refusal = makeRefusal(pb::Refusal::VERSION, "no", true);
  refusal.mutable_ours()->set_major(2);
  refusal.mutable_ours()->set_minor(4);
  refusal.mutable_theirs()->set_major(1);
  EXPECT_THAT(errorOf(refusal).message, testing::AllOf(testing::HasSubstr("2.4"), testing::HasSubstr("1.0")));
}

TEST(Refusal, aReasonOfANewerPeerHasANumberForAName) {
  EXPECT_EQ(reasonName(static_cast<pb::Refusal::Reason>(99)), "reason 99");
  EXPECT_EQ(reasonName(pb::Refusal::GAP), "GAP");
}

}  // namespace
}  // namespace needlelab
