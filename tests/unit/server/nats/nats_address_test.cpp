#include "server/nats/nats_address.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <optional>
#include <string>

#include "server/nats/drop_queue.h"
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

TEST(NatsSubjects, haveATokenForAnyName) {
  EXPECT_EQ(subjectToken("bench-1_B"), "bench-1_B");
  EXPECT_EQ(subjectToken("a b.c*>="), "a=20b=2ec=2a=3e=3d");
  std::string all;
  for (int c = 0; c < 256; ++c) all += static_cast<char>(c);
  EXPECT_EQ(nameOfToken(subjectToken(all)), all);
  for (const char* const none : {"", "a.b", "a b", "*", ">", "=", "=2", "=2g", "=41", "=2E", "ä"})
    EXPECT_EQ(nameOfToken(none), std::nullopt) << none;
}

TEST(NatsSubjects, areReadAsTheyAreWritten) {
  for (const LivePlane plane :
       {LivePlane::kPresence, LivePlane::kWatch, LivePlane::kLive, LivePlane::kAsk, LivePlane::kAnswer}) {
    const auto parts = partsOfSubject("lab 1", subjectOf("lab 1", plane, "room.2"));
    ASSERT_TRUE(parts);
    EXPECT_EQ(parts->plane, plane);
    EXPECT_EQ(parts->name, "room.2");
  }
  EXPECT_EQ(subjectOf("l", LivePlane::kPresence, std::nullopt), "nl.l.presence.*");
  EXPECT_EQ(subjectOf("l", LivePlane::kLive, "bench-1"), "nl.l.live.bench-1");
  for (const char* const none : {"", "nl", "nl.l", "nl.l.live", "nl.l.live.", "nl.m.live.a", "nl.l.other.a",
                                 "nl.l.live.a.b", "xx.l.live.a", "nl.l.live.*"})
    EXPECT_FALSE(partsOfSubject("l", none)) << none;
}

struct Item {
  std::string text;
  [[nodiscard]] std::size_t bytes() const { return text.size(); }
};

TEST(DropQueue, dropsTheOldestByNumberAndByBytes) {
  DropQueue<Item> queue(3, 10);
  for (const char* const text : {"a", "b", "c"}) EXPECT_EQ(queue.push({text}), 0u);
  EXPECT_EQ(queue.push({"d"}), 1u);
  EXPECT_EQ(queue.pop()->text, "b");
  EXPECT_EQ(queue.push({"123456789"}), 1u) << "two letters and nine are too many";
  EXPECT_EQ(queue.bytes(), 10u);
  EXPECT_EQ(queue.push({"longer than the bound"}), 2u) << "the newest stays";
  EXPECT_EQ(queue.size(), 1u);
  EXPECT_EQ(queue.pop()->text, "longer than the bound");
  EXPECT_FALSE(queue.pop());
  EXPECT_EQ(queue.bytes(), 0u);
  EXPECT_EQ(queue.push({"x"}), 0u);
  EXPECT_EQ(queue.clear(), 1u);
  EXPECT_TRUE(queue.empty());
}

TEST(BackOff, doublesUpToABoundAndVaries) {
  BackOff off;
  EXPECT_EQ(off.next(1).count(), 100);
  EXPECT_EQ(off.next(0).count(), 100);
  EXPECT_EQ(off.next(0.5).count(), 300);
  for (int i = 0; i < 20; ++i) (void)off.next(0);
  EXPECT_EQ(off.next(0).count(), 1000);
  EXPECT_EQ(off.next(1), BackOff::kLast);
  off.reset();
  EXPECT_EQ(off.next(0).count(), 50);
}

}  // namespace
}  // namespace needlelab
