#include "server/nats/nats_address.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/temp_folder.h"

namespace needlelab {
namespace {

using test::TempFolder;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

std::vector<std::string> urlsOf(const std::string& text) {
  const auto address = parseNatsAddress(text);
  EXPECT_TRUE(address.ok()) << address.error().message;
  std::vector<std::string> urls;
  if (address.ok())
    for (const NatsServer& server : address->servers) urls.push_back(server.url());
  return urls;
}

TEST(NatsAddress, readsOneServerOrSeveral) {
  EXPECT_THAT(urlsOf("nats://a.example:4222"), ElementsAre("nats://a.example:4222"));
  EXPECT_THAT(urlsOf("nats://a,b:4223, nats://10.0.0.1"),
              ElementsAre("nats://a:4222", "nats://b:4223", "nats://10.0.0.1:4222"));
  EXPECT_THAT(urlsOf("tls://[fd00::1]:4222,[fd00::2]"),
              ElementsAre("nats://[fd00::1]:4222", "nats://[fd00::2]:4222"));
  EXPECT_FALSE(parseNatsAddress("nats://a")->tls);
  EXPECT_TRUE(parseNatsAddress("tls://a,b")->tls);
}

TEST(NatsAddress, refusesInvalidAddresses) {
  for (const char* const text :
       {"", "a", "http://a", "nats://", "nats://a:", "nats://a:0", "nats://a:65536", "nats://a:x",
        "nats://a,,b", "nats://a,", "nats://fd00::1", "nats://[fd00::1", "nats://a b", "nats://a/b",
        "nats://a,tls://b", "tls://a,nats://b", "nats://a\n"}) {
    const auto address = parseNatsAddress(text);
    ASSERT_FALSE(address.ok()) << text;
    EXPECT_EQ(address.error().code, ErrorCode::kInvalidInput) << text;
    EXPECT_THAT(address.error().message, HasSubstr("--live")) << text;
  }
  std::string many = "nats://a";
  for (int i = 0; i < 16; ++i) many += ",a";
  EXPECT_FALSE(parseNatsAddress(many).ok());
}

TEST(NatsAddress, aPasswordDoesNotStandInIt) {
  const auto address = parseNatsAddress("nats://needlelab:secret@a:4222");
  ASSERT_FALSE(address.ok());
  EXPECT_THAT(address.error().message, HasSubstr("--live-user"));
  EXPECT_THAT(address.error().message, Not(HasSubstr("secret")));
}

class NatsUserTest : public testing::Test {
 protected:
  Result<NatsUser> read(const std::string& text, std::filesystem::perms mode = std::filesystem::perms(0600)) {
    const auto file = folder.write("nats.user", text);
    std::filesystem::permissions(file, mode);
    return readNatsUser(file);
  }
  TempFolder folder;
};

TEST_F(NatsUserTest, isTwoLines) {
  const auto user = read("# of server a\nuser = a\npassword =  with = and spaces \r\n\n");
  ASSERT_TRUE(user.ok()) << user.error().message;
  EXPECT_EQ(user->user, "a");
  EXPECT_EQ(user->password, "with = and spaces");
  EXPECT_TRUE(user->creds.empty());
}

TEST_F(NatsUserTest, orAFileOfNatssOwn) {
  const auto user = read("-----BEGIN NATS USER JWT-----\neyJ0\n------END NATS USER JWT------\n");
  ASSERT_TRUE(user.ok()) << user.error().message;
  EXPECT_EQ(user->creds, folder.path() / "nats.user");
}

TEST_F(NatsUserTest, sharedOrInvalidCredentialsAreRefused) {
  EXPECT_THAT(read("user = a\npassword = b\n", std::filesystem::perms(0640)).error().message,
              HasSubstr("chmod 600"));
  for (const char* const text : {"", "user = a\n", "password = hidden\n", "user = a\npassword =\n",
                                 "hidden\n", "user = a\npassword = b\nseed = hidden\n"}) {
    const auto user = read(text);
    ASSERT_FALSE(user.ok()) << text;
    EXPECT_EQ(user.error().code, ErrorCode::kInvalidInput);
    EXPECT_THAT(user.error().message, Not(HasSubstr("hidden")));
  }
  EXPECT_EQ(readNatsUser(folder.path() / "missing").error().code, ErrorCode::kInvalidInput);
}

}  // namespace
}  // namespace needlelab
