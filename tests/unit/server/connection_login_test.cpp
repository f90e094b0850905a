#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "running_server.h"

namespace needlelab {
namespace {

using namespace test;
using testing::HasSubstr;

TEST(LogIn, aStationWithItsKeyIsWelcome) {
  RunningServer server;
  const std::string key = server.addStation("bench-1");
  auto client = server.connect(stationLogin("bench-1", key));
  ASSERT_TRUE(client.ok()) << client.error().message;
  EXPECT_EQ(client->welcome().name(), "bench-1");
  EXPECT_EQ(client->welcome().role(), pb::STATION);
  EXPECT_EQ(client->welcome().open_sessions_size(), 0);
  EXPECT_NEAR(static_cast<double>(client->welcome().server_unix_ns()), static_cast<double>(wallNowNs()), 5e9);
}

TEST(LogIn, unknownWrongAndRevokedAreNotToldApart) {
  RunningServer server;
  std::string key = server.addStation("bench-1");
  const std::string revoked_key = server.addStation("bench-2");
  pb::Request revoke;
  revoke.mutable_revoke_station()->set_name("bench-2");
  server.asAdmin(revoke);
  key[5] = static_cast<char>(key[5] ^ 1);
  std::vector<std::string> texts;
  for (const auto& login :
       {stationLogin("bench-1", key), stationLogin("nobody", key), stationLogin("bench-2", revoked_key)}) {
    const auto client = server.connect(login);
    ASSERT_FALSE(client.ok());
    EXPECT_EQ(client.error().code, ErrorCode::kDenied);
    texts.push_back(client.error().message);
  }
  EXPECT_EQ(texts[0], texts[1]);
  EXPECT_EQ(texts[0], texts[2]);
}

TEST(LogIn, anotherMajorVersionIsRefusedWithBothVersions) {
  RunningServer server;
  auto config = server.config(stationLogin("bench-1", server.addStation("bench-1")));
  config.version.set_major(kProtocolMajor + 6);
  config.version.set_minor(3);
  const auto client = BlockingClient::connect(config);
  ASSERT_FALSE(client.ok());
  EXPECT_EQ(client.error().code, ErrorCode::kVersion);
  EXPECT_THAT(client.error().message, HasSubstr(versionText(ourVersion())));
  EXPECT_THAT(client.error().message, HasSubstr(versionText(config.version)));
}

TEST(LogIn, anotherMinorVersionIsWelcome) {
  RunningServer server;
  auto config = server.config(stationLogin("bench-1", server.addStation("bench-1")));
  config.version.set_minor(kProtocolMinor + 9);
  EXPECT_TRUE(BlockingClient::connect(config).ok());
}

TEST(LogIn, aTokenStandsForThePasswordUntilTheAccountIsDisabled) {
  RunningServer server;
  server.addUser("anna", pb::INSTRUCTOR, "correct horse battery");
  auto first = server.connect(personLogin("anna", "correct horse battery"));
  ASSERT_TRUE(first.ok()) << first.error().message;
  EXPECT_EQ(first->welcome().role(), pb::INSTRUCTOR);
  pb::Login by_token;
  by_token.set_token(first->welcome().token());
  auto second = server.connect(by_token);
  ASSERT_TRUE(second.ok()) << second.error().message;
  EXPECT_EQ(second->welcome().name(), "anna");

  pb::Request disable;
  disable.mutable_disable_user()->set_name("anna");
  server.asAdmin(disable);
  EXPECT_EQ(server.connect(by_token).error().code, ErrorCode::kDenied);
  by_token.set_token(std::string(32, 'x'));
  EXPECT_EQ(server.connect(by_token).error().code, ErrorCode::kDenied);
}

TEST(LogIn, disablingAnAccountOverTheWireEndsItsConnections) {
  RunningServer server;
  server.addUser("anna", pb::INSTRUCTOR, "correct horse battery");
  server.addUser("chief", pb::ADMINISTRATOR, "another long password");
  auto anna = server.connect(personLogin("anna", "correct horse battery"));
  auto chief = server.connect(personLogin("chief", "another long password"));
  ASSERT_TRUE(anna.ok() && chief.ok());
  pb::Request disable;
  disable.mutable_disable_user()->set_name("anna");
  ASSERT_TRUE(chief->call(disable).ok());
  const auto refusal = waitForRefusal(*anna);
  EXPECT_EQ(refusal.reason(), pb::Refusal::LOGIN);
  EXPECT_TRUE(refusal.fatal());
}

TEST(LogIn, guessingIsSlowedDown) {
  RunningServer server([](ServerOptions& options) { options.guard.allowed_per_name = 2; });
  server.addUser("anna", pb::INSTRUCTOR, "correct horse battery");
  for (int i = 0; i < 2; ++i)
    EXPECT_EQ(server.connect(personLogin("anna", "guess")).error().code, ErrorCode::kDenied);
  const auto third = server.connect(personLogin("anna", "correct horse battery"));
  ASSERT_FALSE(third.ok());
  EXPECT_EQ(third.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(third.error().message, HasSubstr("RATE_LIMITED"));
}

TEST(LogIn, theOlderConnectionOfAStationIsClosedWithAReason) {
  RunningServer server;
  const std::string key = server.addStation("bench-1");
  auto older = server.connect(stationLogin("bench-1", key));
  ASSERT_TRUE(older.ok());
  auto newer = server.connect(stationLogin("bench-1", key));
  ASSERT_TRUE(newer.ok());
  const auto refusal = waitForRefusal(*older);
  EXPECT_EQ(refusal.reason(), pb::Refusal::CONFLICT);
  EXPECT_TRUE(refusal.fatal());
  // the newer one works
  FakeSession session("bench-1");
  ASSERT_TRUE(newer->send(session.open()).ok());
  (void)waitFor(*newer, [](const pb::Envelope& e) { return e.has_session_opened(); });
}

TEST(LogIn, anUntrustedServerIsNotTalkedTo) {
  RunningServer server, other;
  auto config = server.config(stationLogin("bench-1", server.addStation("bench-1")));
  config.ca_file = other.server().caFile();
  const auto client = BlockingClient::connect(config);
  ASSERT_FALSE(client.ok());
  EXPECT_EQ(client.error().code, ErrorCode::kDenied);
}

TEST(LogIn, nobodyThereIsUnavailable) {
  RunningServer server;
  auto config = server.config(stationLogin("bench-1", "x"));
  (void)server.stop();
  const auto client = BlockingClient::connect(config);
  ASSERT_FALSE(client.ok());
  EXPECT_EQ(client.error().code, ErrorCode::kUnavailable);
}

}  // namespace
}  // namespace needlelab
