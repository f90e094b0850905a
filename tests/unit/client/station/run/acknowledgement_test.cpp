#include "client/station/run/acknowledgement.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <string>

namespace needlelab {
namespace {

class EnterKeyTest : public testing::Test {
 protected:
  EnterKeyTest() { EXPECT_EQ(::pipe(ends_.data()), 0); }
  ~EnterKeyTest() override {
    for (const int end : ends_)
      if (end >= 0) ::close(end);
  }
  void type(const std::string& text) {
    ASSERT_EQ(::write(ends_[1], text.data(), text.size()), static_cast<ssize_t>(text.size()));
  }
  std::array<int, 2> ends_{-1, -1};
};

TEST_F(EnterKeyTest, onlyAWholeLineCountsAndOnlyOnce) {
  EnterKey key(ends_[0]);
  EXPECT_FALSE(key.isTerminal());
  EXPECT_FALSE(key.pressed());
  type("abc");
  EXPECT_FALSE(key.pressed());
  type("\n");
  EXPECT_TRUE(key.pressed());
  EXPECT_FALSE(key.pressed());
  type("\n\n\n");
  EXPECT_TRUE(key.pressed()) << "what was typed in haste is one";
  EXPECT_FALSE(key.pressed());
}

TEST_F(EnterKeyTest, anEndOfInputIsNoEnterAndNeverWaits) {
  EnterKey key(ends_[0]);
  type("x\n");
  ::close(ends_[1]);
  ends_[1] = -1;
  EXPECT_TRUE(key.pressed());
  const auto before = std::chrono::steady_clock::now();
  for (int k = 0; k < 1000; ++k) EXPECT_FALSE(key.pressed());
  EXPECT_LT(std::chrono::steady_clock::now() - before, std::chrono::seconds(1));
}

TEST_F(EnterKeyTest, aFloodIsReadInBoundedPieces) {
  EnterKey key(ends_[0]);
  ::fcntl(ends_[1], F_SETFL, O_NONBLOCK);
  const std::string much(60'000, '\n');
  ASSERT_GT(::write(ends_[1], much.data(), much.size()), 0);
  EXPECT_TRUE(key.pressed());
}

TEST(EnterKey, nothingToReadFromIsNoEnter) {
  EnterKey nothing(-1);
  EXPECT_FALSE(nothing.pressed());
  const int null = ::open("/dev/null", O_RDONLY);
  EnterKey from_null(null);
  EXPECT_FALSE(from_null.pressed());
  ::close(null);
}

}  // namespace
}  // namespace needlelab
