// The console's live page of a server whose NATS does not answer.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/unit/server/web/web_lab.h"

namespace needlelab {
namespace {

using namespace test;

TEST(LivePageOfMany, saysWhichServerHasAStationAndThatOthersMayBeMissing) {
  WebLab lab([](ServerOptions& options) {
    options.live.nats.address = "nats://127.0.0.1:1";
    options.live.lab = "lab";
    options.live.name = "server-a";
  });
  pb::Login login;
  login.mutable_station()->set_station("bench");
  login.mutable_station()->set_key(lab.stationKey());
  auto station = lab.server().connect(login);
  ASSERT_TRUE(station.ok());
  Browser ines = lab.browserOf("ines");
  const auto page = ines.live();
  ASSERT_TRUE(page);
  nlohmann::json board;
  for (int i = 0; i < 50 && (board.is_null() || board["tiles"][0]["online"] != true); ++i) {
    const auto text = page->readText();
    ASSERT_TRUE(text.has_value());
    board = nlohmann::json::parse(*text);
  }
  EXPECT_EQ(board["live_trouble"], "the live connection between servers is down");
  EXPECT_EQ(board["tiles"][0]["server"], "server-a");
}

TEST(LivePageOfMany, aDatabaseOnSqliteWantsANameOfTheLab) {
  TempFolder folder;
  ServerOptions options;
  options.data = folder.path() / "data";
  options.listen = "127.0.0.1:0";
  options.web.listen = "off";
  options.live.nats.address = "nats://127.0.0.1:1";
  const auto refused = Server::start(std::move(options));
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidInput);
  EXPECT_THAT(refused.error().message, testing::HasSubstr("--live-lab"));
}

}  // namespace
}  // namespace needlelab
