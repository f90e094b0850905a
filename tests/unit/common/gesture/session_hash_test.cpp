#include "common/gesture/chunk.h"

#include <gtest/gtest.h>

namespace needlelab {
namespace {

TEST(SessionHash, knownValues) {
  // BLAKE2b with a 32-byte digest, as `b2sum -l 256` prints it for no input and for "abc"
  SessionHash hash;
  EXPECT_EQ(hexOf(hash.digest()), "0e5751c026e543b2e8ab2eb06099daa1d1e5df47778f7787faab45cdf12fe3a8");
  hash.update(viewOf("abc"));
  EXPECT_EQ(hexOf(hash.digest()), "bddd813c634239723171ef3fee98579b94964e3bb1cb3e427262c8c068d52319");
}

TEST(SessionHash, piecesGiveTheHashOfTheWholeAndMayBeAskedBetween) {
  SessionHash whole, pieces;
  whole.update(viewOf("chunk one chunk two"));
  pieces.update(viewOf("chunk one "));
  (void)pieces.digest();
  const SessionHash copy = pieces;
  pieces.update(viewOf("chunk two"));
  EXPECT_EQ(whole.digest(), pieces.digest());
  EXPECT_NE(copy.digest(), pieces.digest());
}

TEST(SessionHash, hexGoesBothWaysAndRefusesOtherText) {
  SessionHash hash;
  hash.update(viewOf("x"));
  const auto back = digestFromHex(hexOf(hash.digest()));
  ASSERT_TRUE(back.ok());
  EXPECT_EQ(*back, hash.digest());
  EXPECT_FALSE(digestFromHex("").ok());
  EXPECT_FALSE(digestFromHex(std::string(63, 'a')).ok());
  EXPECT_FALSE(digestFromHex(std::string(63, 'a') + "g").ok());
  EXPECT_TRUE(digestFromHex(std::string(64, 'F')).ok());
}

}  // namespace
}  // namespace needlelab
