#include "common/base/text/uuid.h"

#include <gtest/gtest.h>

#include <set>

#include "common/base/time/clock.h"

namespace needlelab {
namespace {

TEST(Uuid, versionVariantAndTime) {
  const auto before = static_cast<std::uint64_t>(wallNowNs() / 1'000'000);
  const Uuid id = makeUuidV7();
  const auto after = static_cast<std::uint64_t>(wallNowNs() / 1'000'000);
  EXPECT_EQ(id[6] >> 4, 7);
  EXPECT_EQ(id[8] >> 6, 0b10);
  std::uint64_t ms = 0;
  for (std::size_t i = 0; i < 6; ++i) ms = ms << 8 | id[i];
  EXPECT_GE(ms, before);
  EXPECT_LE(ms, after);
}

TEST(Uuid, textGoesThereAndBack) {
  for (int i = 0; i < 100; ++i) {
    const Uuid id = makeUuidV7();
    const std::string text = uuidText(id);
    ASSERT_EQ(text.size(), 36u);
    const auto back = parseUuid(text);
    ASSERT_TRUE(back.ok());
    EXPECT_EQ(*back, id);
  }
  const auto known = parseUuid("019aa0c3-7C1E-7b3a-9d5e-0123456789ab");
  ASSERT_TRUE(known.ok());
  EXPECT_EQ(uuidText(*known), "019aa0c3-7c1e-7b3a-9d5e-0123456789ab");
}

TEST(Uuid, tenThousandAreAllDifferent) {
  std::set<Uuid> seen;
  for (int i = 0; i < 10'000; ++i) seen.insert(makeUuidV7());
  EXPECT_EQ(seen.size(), 10'000u);
}

TEST(Uuid, otherTextIsRefusedWithAnExample) {
  const std::string good = "019aa0c3-7c1e-7b3a-9d5e-0123456789ab";
  std::vector<std::string> bad = {"", good.substr(1), good + "0", "{" + good + "}", std::string(36, '-')};
  for (std::size_t i = 0; i < good.size(); ++i) {
    std::string changed = good;
    changed[i] = 'g';
    bad.push_back(changed);
  }
  for (const auto& text : bad) {
    const auto id = parseUuid(text);
    ASSERT_FALSE(id.ok()) << text;
    EXPECT_EQ(id.error().code, ErrorCode::kInvalidInput);
    EXPECT_NE(id.error().message.find("36 characters"), std::string::npos);
  }
}

}  // namespace
}  // namespace needlelab
