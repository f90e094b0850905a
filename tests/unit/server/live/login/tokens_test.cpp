#include "server/live/login/tokens.h"

#include <gtest/gtest.h>

#include "tests/unit/server/live/milliseconds.h"

namespace needlelab {
namespace {

const Tokens::Holder kAnna{{"anna", pb::INSTRUCTOR}, 0};

TEST(Tokens, aTokenLastsForItsStatedTime) {
  Tokens tokens({.lifetime = std::chrono::milliseconds(1000)});
  const auto issued = tokens.issue(kAnna, 5 * kMs);
  EXPECT_EQ(issued.token.size(), 32u);
  EXPECT_EQ(issued.expires_ns, 1005 * kMs);
  ASSERT_TRUE(tokens.find(issued.token, 1004 * kMs).has_value());
  EXPECT_EQ(tokens.find(issued.token, 1004 * kMs)->who.name, "anna");
  EXPECT_FALSE(tokens.find(issued.token, 1005 * kMs).has_value());
  tokens.tidy(1005 * kMs);
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
             c = tokens.issue({{"bert", pb::INSTRUCTOR}, 0}, 0);
  EXPECT_NE(a.token, b.token);
  EXPECT_EQ(tokens.forget("anna"), 2u);
  EXPECT_FALSE(tokens.find(a.token, 0).has_value());
  EXPECT_FALSE(tokens.find(b.token, 0).has_value());
  EXPECT_TRUE(tokens.find(c.token, 0).has_value());
}

TEST(Tokens, repeatedExchangesStillEndAtTheLongestLifetime) {
  // 1 s each, at most 5 s after the password
  Tokens tokens({.lifetime = std::chrono::milliseconds(1000), .longest = std::chrono::milliseconds(5000)});
  std::int64_t now = 0;
  auto issued = tokens.issue(kAnna, now);
  int exchanged = 0;
  for (;;) {
    now += 900 * kMs;
    const auto holder = tokens.find(issued.token, now);
    if (!holder) break;
    issued = tokens.issue(*holder, now);
    ASSERT_LE(issued.expires_ns, 5000 * kMs);
    ASSERT_LT(++exchanged, 100);
  }
  // at 0.9, 1.8, 2.7, 3.6 and 4.5 s; the last token ends at 5 s instead of 5.5 s
  EXPECT_EQ(exchanged, 5);
  EXPECT_EQ(issued.expires_ns, 5000 * kMs);
}

TEST(Tokens, memoryIsBounded) {
  Tokens tokens({.max_tokens = 10});
  const auto first = tokens.issue(kAnna, 0);
  for (int i = 1; i < 100; ++i) (void)tokens.issue(kAnna, i);
  EXPECT_EQ(tokens.size(), 10u);
  EXPECT_FALSE(tokens.find(first.token, 100).has_value());
}

}  // namespace
}  // namespace needlelab
