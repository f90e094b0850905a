#include <gtest/gtest.h>
#include <sodium.h>

#include <ctime>
#include <set>

#include "db/login/credentials.h"
#include "tests/support/store/password_cost.h"
#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

TEST(Password, onlyTheRightOneVerifies) {
  const test::ProductPasswordCost product;
  const auto hash = hashPassword("correct horse");
  ASSERT_TRUE(hash.ok());
  EXPECT_EQ(hash->rfind("$argon2id$v=19$m=65536,t=2,p=1$", 0), 0u) << *hash;
  EXPECT_EQ(hash->find('\0'), std::string::npos);
  EXPECT_TRUE(*verifyPassword(*hash, "correct horse"));
  EXPECT_FALSE(*verifyPassword(*hash, "correct horsf"));
  EXPECT_FALSE(*verifyPassword(*hash, ""));
  EXPECT_NE(*hashPassword("correct horse"), *hash) << "no salt";
}

TEST(Password, lengthsAreLimited) {
  EXPECT_EQ(hashPassword("short").error().code, ErrorCode::kInvalidInput);
  EXPECT_EQ(hashPassword(std::string(257, 'x')).error().code, ErrorCode::kInvalidInput);
}

TEST(Password, anInvalidHashNeverVerifies) {
  for (const std::string& hash : {std::string(), std::string("nonsense"), std::string(10'000, 'x')}) {
    EXPECT_FALSE(*verifyPassword(hash, "password"));
  }
  const auto hash = hashPassword(std::string(256, 'x'));
  EXPECT_FALSE(*verifyPassword(*hash, std::string(257, 'x')));
}

// libsodium's own check reports it as a wrong password. A hash states its memory: here more than can exist.
TEST(Password, aLackOfMemoryIsNotAWrongPassword) {
  auto hash = *hashPassword("correct horse");
  const std::size_t from = hash.find("m="), to = hash.find(",t=");
  ASSERT_NE(to, std::string::npos) << hash;
  hash.replace(from, to - from, "m=4294967296");
  for (const char* password : {"correct horse", "wrong horse"}) {
    const auto checked = verifyPassword(hash, password);
    ASSERT_FALSE(checked.ok());
    EXPECT_EQ(checked.error().code, ErrorCode::kFailed);
    EXPECT_EQ(checked.error().message,
              "cannot check a password or code: not enough memory (4194304 MiB are needed)");
  }
}

// Hashes made by libsodium itself and readable by it, of both costs.
TEST(Password, hashesOfTheLibraryVerify) {
  ASSERT_GE(sodium_init(), 0);
  std::string hash(crypto_pwhash_STRBYTES, '\0');
  ASSERT_EQ(crypto_pwhash_str(hash.data(), "correct horse", 13, 3, std::size_t{1} << 20), 0);
  hash.resize(hash.find('\0'));
  EXPECT_TRUE(*verifyPassword(hash, "correct horse"));
  EXPECT_FALSE(*verifyPassword(hash, "correct horsf"));
  for (const std::size_t cut : {std::size_t{1}, hash.size() / 2, hash.size() - 1})
    EXPECT_FALSE(*verifyPassword(hash.substr(0, cut), "correct horse")) << cut;
  EXPECT_FALSE(*verifyPassword(hash + "x", "correct horse"));
}

TEST(Password, anUnknownNameIsAsMuchWorkAsAWrongPassword) {
  const auto workOf = [](const std::string& stored) {
    const test::PasswordChecks checks;
    EXPECT_FALSE(*verifyPassword(stored, "wrong password"));
    return checks.all();
  };
  const auto wrong = workOf(*hashPassword("correct horse"));
  ASSERT_EQ(wrong.size(), 1u);
  for (const char* stored : {"", "no hash"}) {
    const auto unknown = workOf(stored);
    ASSERT_EQ(unknown.size(), 1u);
    EXPECT_EQ(unknown[0].operations, wrong[0].operations);
    EXPECT_EQ(unknown[0].memory_bytes, wrong[0].memory_bytes);
  }
}

TEST(Credentials, aCodeIsHashedAsAPasswordButMayBeShort) {
  const auto hash = hashCode("2468");
  ASSERT_TRUE(hash.ok()) << hash.error().message;
  EXPECT_EQ(hash->rfind("$argon2id$", 0), 0u) << *hash;
  EXPECT_TRUE(*verifyPassword(*hash, "2468"));
  EXPECT_FALSE(*verifyPassword(*hash, "2469"));
  EXPECT_FALSE(*verifyPassword(*hash, ""));
  EXPECT_TRUE(hashCode(std::string(64, '~')).ok());
  EXPECT_TRUE(hashCode("A b 1").ok());
}

TEST(Credentials, whatIsNoCodeIsNotHashed) {
  for (const std::string& wrong : {std::string("123"), std::string("12\n45")}) {
    const auto refused = hashCode(wrong);
    ASSERT_FALSE(refused.ok());
    EXPECT_EQ(refused.error().code, ErrorCode::kInvalidInput);
  }
}

TEST(Credentials, aMadeCodeIsSixDigitsWithAllFirstDigits) {
  std::set<char> first;
  for (int i = 0; i < 1000; ++i) {
    const std::string pin = makePin();
    EXPECT_EQ(pin.size(), 6u);
    EXPECT_EQ(pin.find_first_not_of("0123456789"), std::string::npos) << pin;
    first.insert(pin[0]);
  }
  // one of ten is missing once in 10^44 runs
  EXPECT_EQ(first.size(), 10u);
}

TEST(StationKey, isRandomAndItsHashIsAnother) {
  const auto a = makeStationKey(), b = makeStationKey();
  EXPECT_NE(a, b);
  EXPECT_FALSE(sameHash(hashStationKey(a), hashStationKey(b)));
  EXPECT_TRUE(sameHash(hashStationKey(a), hashStationKey(a)));
  EXPECT_NE(hashStationKey(a), a);
}

std::string textOfKey(const StationKeyBytes& key) {
  return {key.begin(), key.end()};
}

TEST(StationStore, takesTheRightKeyOnly) {
  test::TestDb db;
  StationStore stations(db.writer);
  const StationKeyBytes key = makeStationKey();
  ASSERT_OK(stations.add("lab-1", hashStationKey(key), 5));
  EXPECT_TRUE(*stations.checkKey("lab-1", textOfKey(key)));
  auto wrong = key;
  wrong[31] ^= 1;
  EXPECT_FALSE(*stations.checkKey("lab-1", textOfKey(wrong)));
  EXPECT_FALSE(*stations.checkKey("lab-1", textOfKey(key).substr(1)));
  EXPECT_FALSE(*stations.checkKey("lab-1", textOfKey(key) + "x"));
  EXPECT_FALSE(*stations.checkKey("lab-1", ""));
  EXPECT_FALSE(*stations.checkKey("lab-2", textOfKey(key)));
  // The stored value is not the key.
  EXPECT_FALSE(*stations.checkKey("lab-1", textOfKey(hashStationKey(key))));
}

TEST(StationStore, aRevokedStationIsOutUntilItGetsANewKey) {
  test::TestDb db;
  StationStore stations(db.writer);
  const StationKeyBytes old_key = makeStationKey(), new_key = makeStationKey();
  ASSERT_OK(stations.add("lab-1", hashStationKey(old_key), 5));
  EXPECT_EQ(stations.add("lab-1", hashStationKey(new_key), 6).error().code, ErrorCode::kAlreadyExists);
  EXPECT_TRUE(*stations.checkKey("lab-1", textOfKey(old_key)));
  ASSERT_OK(stations.revoke("lab-1"));
  EXPECT_FALSE(*stations.checkKey("lab-1", textOfKey(old_key)));
  ASSERT_OK(stations.add("lab-1", hashStationKey(new_key), 7));
  EXPECT_FALSE(*stations.checkKey("lab-1", textOfKey(old_key)));
  EXPECT_TRUE(*stations.checkKey("lab-1", textOfKey(new_key)));
  EXPECT_EQ(stations.find("lab-1")->value().created_unix_ns, 5);
  EXPECT_EQ(stations.revoke("nobody").error().code, ErrorCode::kNotFound);
  EXPECT_EQ(stations.list()->size(), 2u);
}

}  // namespace

}  // namespace needlelab
