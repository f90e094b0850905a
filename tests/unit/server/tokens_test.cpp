#include "server/tokens.h"

#include <gtest/gtest.h>

namespace needlelab {
namespace {

constexpr std::int64_t kMs = 1'000'000;
const Principal kAnna{"anna", pb::INSTRUCTOR};

TEST(Tokens, aTokenLastsAsLongAsItSays) {
  Tokens tokens(std::chrono::milliseconds(1000));
  const auto issued = tokens.issue(kAnna, 5 * kMs);
  EXPECT_EQ(issued.token.size(), 32u);
  EXPECT_EQ(issued.expires_ns, 1005 * kMs);
  ASSERT_TRUE(tokens.find(issued.token, 1004 * kMs).has_value());
  EXPECT_EQ(tokens.find(issued.token, 1004 * kMs)->name, "anna");
  EXPECT_FALSE(tokens.find(issued.token, 1005 * kMs).has_value());
  EXPECT_EQ(tokens.size(), 0u);
}

TEST(Tokens, noOtherTextIsAToken) {
  Tokens tokens;
  auto token = tokens.issue(kAnna, 0).token;
  EXPECT_FALSE(tokens.find("", 0).has_value());
  EXPECT_FALSE(tokens.find(token.substr(0, 31), 0).has_value());
  token[0] = static_cast<char>(token[0] ^ 1);
  EXPECT_FALSE(tokens.find(token, 0).has_value());
}

TEST(Tokens, twoAreNeverTheSameAndForgettingEndsThemAll) {
  Tokens tokens;
  const auto a = tokens.issue(kAnna, 0), b = tokens.issue(kAnna, 0),
             c = tokens.issue({"bert", pb::INSTRUCTOR}, 0);
  EXPECT_NE(a.token, b.token);
  tokens.forget("anna");
  EXPECT_FALSE(tokens.find(a.token, 0).has_value());
  EXPECT_FALSE(tokens.find(b.token, 0).has_value());
  EXPECT_TRUE(tokens.find(c.token, 0).has_value());
}

TEST(Tokens, memoryIsBounded) {
  Tokens tokens(std::chrono::minutes(15), 10);
  const auto first = tokens.issue(kAnna, 0);
  for (int i = 1; i < 100; ++i) (void)tokens.issue(kAnna, i);
  EXPECT_EQ(tokens.size(), 10u);
  EXPECT_FALSE(tokens.find(first.token, 100).has_value());
}

}  // namespace
}  // namespace needlelab
