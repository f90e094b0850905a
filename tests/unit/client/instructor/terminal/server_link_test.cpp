#include "client/instructor/terminal/server_link.h"

#include <gtest/gtest.h>

#include "tests/unit/server/live/running_server.h"

namespace needlelab {
namespace {

using namespace test;

TEST(ServerLink, comesBackAfterTheServerStartedAgain) {
  int port = 0;
  RunningServer server([&](ServerOptions& options) {
    if (port != 0) options.listen = "127.0.0.1:" + std::to_string(port);
  });
  port = server.server().port();
  server.addUser("anna", pb::INSTRUCTOR, "correct horse battery");
  ServerLink link(server.config({}), "anna", "correct horse battery");
  ASSERT_TRUE(link.connect().ok());
  (void)server.restart();
  while (link.client().receive(milliseconds(1000)).ok()) {
  }
  EXPECT_FALSE(link.client().connected());
  // the new server knows no tokens of the old one: the password is used
  const auto back = link.reconnect(ServerLink::Clock::now() + std::chrono::seconds(10), [] { return false; });
  ASSERT_TRUE(back.ok()) << back.error().message;
  EXPECT_TRUE(link.client().connected());
}

TEST(ServerLink, aWrongPasswordIsNotTriedAgain) {
  RunningServer server;
  server.addUser("anna", pb::INSTRUCTOR, "correct horse battery");
  ServerLink link(server.config({}), "anna", "wrong");
  EXPECT_EQ(link.connect().error().code, ErrorCode::kDenied);
  const auto started = ServerLink::Clock::now();
  const auto again = link.reconnect(started + std::chrono::seconds(30), [] { return false; });
  EXPECT_EQ(again.error().code, ErrorCode::kDenied);
  EXPECT_LT(ServerLink::Clock::now() - started, std::chrono::seconds(5));
}

}  // namespace
}  // namespace needlelab
