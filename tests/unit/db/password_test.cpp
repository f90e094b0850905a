#include "db/password.h"

#include <gtest/gtest.h>

#include <chrono>

namespace needlelab {
namespace {

TEST(Password, onlyTheRightOneVerifies) {
  const auto hash = hashPassword("correct horse");
  ASSERT_TRUE(hash.ok());
  EXPECT_EQ(hash->rfind("$argon2id$", 0), 0u) << *hash;
  EXPECT_EQ(hash->find('\0'), std::string::npos);
  EXPECT_TRUE(verifyPassword(*hash, "correct horse"));
  EXPECT_FALSE(verifyPassword(*hash, "correct horsf"));
  EXPECT_FALSE(verifyPassword(*hash, ""));
  EXPECT_NE(*hashPassword("correct horse"), *hash) << "no salt";
}

TEST(Password, lengthsAreLimited) {
  EXPECT_EQ(hashPassword("short").error().code, ErrorCode::kInvalidInput);
  EXPECT_EQ(hashPassword(std::string(257, 'x')).error().code, ErrorCode::kInvalidInput);
}

TEST(Password, aHashThatIsNoneNeverVerifies) {
  for (const std::string& hash : {std::string(), std::string("nonsense"), std::string(10'000, 'x')}) {
    EXPECT_FALSE(verifyPassword(hash, "password"));
  }
  const auto hash = hashPassword(std::string(256, 'x'));
  EXPECT_FALSE(verifyPassword(*hash, std::string(257, 'x')));
}

TEST(Password, anUnknownNameTakesAsLongAsAWrongPassword) {
  const auto hash = hashPassword("correct horse");
  const auto time = [](const std::string& stored) {
    const auto begin = std::chrono::steady_clock::now();
    EXPECT_FALSE(verifyPassword(stored, "wrong password"));
    return std::chrono::steady_clock::now() - begin;
  };
  time("");  // makes the decoy
  EXPECT_GT(time("") * 4, time(*hash));
}

TEST(StationKey, isRandomAndItsHashIsAnother) {
  const auto a = makeStationKey(), b = makeStationKey();
  EXPECT_NE(a, b);
  EXPECT_FALSE(sameHash(hashStationKey(a), hashStationKey(b)));
  EXPECT_TRUE(sameHash(hashStationKey(a), hashStationKey(a)));
  EXPECT_NE(hashStationKey(a), a);
}

}  // namespace
}  // namespace needlelab
