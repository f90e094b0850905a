#include "client/instructor/model/live/lab_connection.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <optional>

#include "client/instructor/model/lab_state.h"
#include "tests/support/patience.h"
#include "tests/support/proxy/fault_proxy.h"
#include "tests/unit/server/live/running_server.h"

namespace needlelab {
namespace {

using namespace test;
using testing::HasSubstr;

class LabConnectionTest : public testing::Test {
 protected:
  int port_ = 0;
  RunningServer server_{[this](ServerOptions& options) {
    if (port_ != 0) options.listen = "127.0.0.1:" + std::to_string(port_);
  }};
  std::string key_;

  void SetUp() override {
    port_ = server_.server().port();
    server_.addUser("anna", pb::INSTRUCTOR, "correct horse battery");
    server_.addUser("tina", pb::TRAINEE, "correct horse battery");
    key_ = server_.addStation("bench-1");
  }
  LabLogin login(const std::string& user = "anna", const std::string& password = "correct horse battery") {
    const auto config = server_.config({});
    return {config.servers(), config.ca_file, user, password};
  }
  static LabConnectionSettings quick() {
    LabConnectionSettings settings;
    settings.first_retry = milliseconds(20);
    settings.max_retry = milliseconds(200);
    return settings;
  }
  /// Polls until the condition holds. Collects the events.
  bool until(LabConnection& lab, const std::function<bool()>& so) {
    const auto end = std::chrono::steady_clock::now() + kPatience;
    while (!so()) {
      if (std::chrono::steady_clock::now() > end) return false;
      auto news = lab.poll();
      for (auto& status : news.statuses) statuses_.push_back(std::move(status));
      for (auto& frame : news.frames) frames_.push_back(std::move(frame));
      std::this_thread::sleep_for(milliseconds(5));
    }
    return true;
  }
  bool untilPhase(LabConnection& lab, LinkPhase phase) {
    return until(lab, [&] { return lab.state().phase == phase; });
  }
  static pb::Request listStations() {
    pb::Request request;
    request.mutable_list_stations();
    return request;
  }

  std::vector<pb::StationStatus> statuses_;
  std::vector<LiveArrival> frames_;
};

TEST_F(LabConnectionTest, logsInAsksAndWatches) {
  LabConnection lab(quick());
  lab.watchAll(0);
  lab.watch("bench-1");
  lab.logIn(login());
  ASSERT_TRUE(untilPhase(lab, LinkPhase::kOnline)) << lab.state().trouble.detail;
  EXPECT_EQ(lab.state().role, pb::INSTRUCTOR);

  std::optional<Result<pb::Reply>> answer;
  lab.ask(listStations(), [&](Result<pb::Reply> reply) { answer.emplace(std::move(reply)); });
  ASSERT_TRUE(until(lab, [&] { return answer.has_value(); }));
  ASSERT_TRUE(answer->ok());
  ASSERT_EQ((*answer)->stations().stations_size(), 1);
  EXPECT_EQ((*answer)->stations().stations(0).name(), "bench-1");

  // a station comes online and is watched at once
  auto station = server_.connect(stationLogin("bench-1", key_));
  ASSERT_TRUE(station.ok());
  (void)waitFor(*station, [](const auto& e) { return e.has_watch_state() && e.watch_state().watched(); });
  const FakeSession session("bench-1");
  ASSERT_TRUE(station->send(session.open()).ok());
  pb::Envelope frame;
  const Bytes data = FakeSession::bytes(0);
  frame.mutable_live_frame()->set_session_id(session.id());
  frame.mutable_live_frame()->set_data(data.data(), data.size());
  frame.mutable_live_frame()->set_capture_unix_ns(wallNowNs());
  ASSERT_TRUE(station->send(frame).ok());
  (void)station->receive(milliseconds(50)).ok();
  ASSERT_TRUE(until(lab, [&] { return !frames_.empty(); }));
  EXPECT_EQ(frames_[0].frame.station(), "bench-1");
  EXPECT_GE(frames_[0].received_unix_ns, frames_[0].frame.capture_unix_ns());
  ASSERT_FALSE(statuses_.empty());

  lab.unwatch("bench-1");
  (void)waitFor(*station, [](const auto& e) { return e.has_watch_state() && !e.watch_state().watched(); });
}

TEST_F(LabConnectionTest, aRestartOfTheServerLosesNeitherWatchesNorQuestions) {
  LabConnection lab(quick());
  lab.watchAll(0);
  lab.watch("bench-1");
  lab.logIn(login());
  ASSERT_TRUE(untilPhase(lab, LinkPhase::kOnline));
  (void)server_.stop();
  ASSERT_TRUE(untilPhase(lab, LinkPhase::kAway));
  EXPECT_FALSE(lab.state().trouble.what.empty());
  EXPECT_FALSE(lab.state().trouble.todo.empty());
  EXPECT_NE(lab.state().away_since_ns, 0);

  // Read requests wait for the server; actions are refused at once.
  std::optional<Result<pb::Reply>> reads, acts;
  lab.ask(listStations(), [&](Result<pb::Reply> reply) { reads.emplace(std::move(reply)); });
  lab.ask(
      listStations(), [&](Result<pb::Reply> reply) { acts.emplace(std::move(reply)); }, OnLoss::kGiveUp);
  ASSERT_TRUE(until(lab, [&] { return acts.has_value(); }));
  EXPECT_EQ(acts->error().code, ErrorCode::kUnavailable);
  EXPECT_FALSE(reads.has_value());

  server_.start();
  ASSERT_TRUE(untilPhase(lab, LinkPhase::kOnline)) << lab.state().trouble.detail;
  ASSERT_TRUE(until(lab, [&] { return reads.has_value(); }));
  EXPECT_TRUE(reads->ok());
  EXPECT_EQ(lab.state().connections, 2u);
  EXPECT_EQ(lab.state().away_since_ns, 0);
  // Subscribed again: the server informs the station.
  auto station = server_.connect(stationLogin("bench-1", key_));
  ASSERT_TRUE(station.ok());
  (void)waitFor(*station, [](const auto& e) { return e.has_watch_state() && e.watch_state().watched(); });
}

// two routes to the server, one of which is cut
TEST_F(LabConnectionTest, anotherServerTakesOverTheWatchesAndIsNamed) {
  const auto port = static_cast<std::uint16_t>(port_);
  FaultProxy first(port), second(port);
  auto by_two = login();
  by_two.servers = {{"127.0.0.1", first.port()}, {"127.0.0.1", second.port()}};
  LabConnection lab(quick());
  lab.watchAll(0);
  lab.watch("bench-1");
  lab.logIn(by_two);
  EXPECT_EQ(lab.state().server, endpointsText(by_two.servers));
  ASSERT_TRUE(untilPhase(lab, LinkPhase::kOnline)) << lab.state().trouble.detail;
  EXPECT_EQ(lab.state().server, endpointText(by_two.servers[0]));
  first.refuseAll(true);
  first.cutAll(Cut::kReset);
  ASSERT_TRUE(until(lab, [&] { return lab.state().connections == 2; })) << lab.state().trouble.detail;
  EXPECT_EQ(lab.state().server, endpointText(by_two.servers[1]));
  auto station = server_.connect(stationLogin("bench-1", key_));
  ASSERT_TRUE(station.ok());
  (void)waitFor(*station, [](const auto& e) { return e.has_watch_state() && e.watch_state().watched(); });
  ASSERT_TRUE(until(lab, [&] { return !statuses_.empty(); }));
  // no route is left: both are named
  second.refuseAll(true);
  second.cutAll(Cut::kReset);
  ASSERT_TRUE(until(lab, [&] {
    return lab.state().trouble.what.find(endpointsText(by_two.servers)) != std::string::npos;
  })) << lab.state().trouble.what;
  EXPECT_THAT(lab.state().trouble.detail, HasSubstr("; "));
}

TEST_F(LabConnectionTest, theWindowReportsAChangeOfServer) {
  const auto port = static_cast<std::uint16_t>(port_);
  FaultProxy first(port), second(port);
  LabState lab({}, quick());
  lab.form = {"127.0.0.1:" + std::to_string(first.port()) + ",127.0.0.1:" + std::to_string(second.port()),
              server_.server().caFile().string(), "anna", "correct horse battery"};
  lab.logIn();
  double now_s = 0;
  const auto updated = [&](const std::function<bool()>& so) {
    return eventually([&] { return lab.update(now_s += 0.01), so(); });
  };
  ASSERT_TRUE(updated([&] { return lab.inside(); })) << lab.form_trouble << lab.link().trouble.detail;
  EXPECT_TRUE(lab.notices.all().empty());
  first.refuseAll(true);
  first.cutAll(Cut::kReset);
  ASSERT_TRUE(updated([&] { return !lab.notices.all().empty(); }));
  EXPECT_EQ(lab.notices.all()[0].text, "Connected to the server 127.0.0.1:" + std::to_string(second.port()) +
                                           ", no longer to 127.0.0.1:" + std::to_string(first.port()));
}

TEST_F(LabConnectionTest, saysInPlainWordsWhatAPersonMustDo) {
  struct Row {
    const char* name;
    std::function<LabLogin()> login;
    LinkPhase phase;
    const char* what;
  };
  const TempFolder folder;
  const std::vector<Row> rows = {
      {"wrong password", [&] { return login("anna", "wrong"); }, LinkPhase::kRefused, "name and password"},
      {"a trainee", [&] { return login("tina"); }, LinkPhase::kRefused, "may not"},
      {"no CA file",
       [&] {
         auto one = login();
         one.ca_file = folder.path() / "none.crt";
         return one;
       },
       LinkPhase::kRefused, "CA file"},
      {"no certificate in it",
       [&] {
         auto one = login();
         one.ca_file = folder.write("empty.crt", "nothing");
         return one;
       },
       LinkPhase::kRefused, "CA file"},
      {"no one there",
       [&] {
         auto one = login();
         one.servers[0].port = 1;
         return one;
       },
       LinkPhase::kAway, "No needlelab-server answers"},
  };
  for (const Row& row : rows) {
    LabConnection lab(quick());
    lab.logIn(row.login());
    ASSERT_TRUE(untilPhase(lab, row.phase)) << row.name << ": " << lab.state().trouble.detail;
    EXPECT_THAT(lab.state().trouble.what, HasSubstr(row.what)) << row.name;
    EXPECT_FALSE(lab.state().trouble.todo.empty()) << row.name;
    EXPECT_FALSE(lab.state().trouble.detail.empty()) << row.name;
  }
}

TEST_F(LabConnectionTest, anotherServersCertificateIsNoPasswordMatter) {
  RunningServer other;
  LabConnection lab(quick());
  auto wrong = login();
  wrong.ca_file = other.server().caFile();
  lab.logIn(wrong);
  ASSERT_TRUE(untilPhase(lab, LinkPhase::kRefused));
  EXPECT_THAT(lab.state().trouble.what, HasSubstr("certificate"));
  EXPECT_THAT(lab.state().trouble.todo, HasSubstr("tls/ca.crt"));
  // now with the correct password
  lab.logIn(login());
  ASSERT_TRUE(untilPhase(lab, LinkPhase::kOnline)) << lab.state().trouble.detail;
  EXPECT_TRUE(lab.state().trouble.what.empty());
}

TEST_F(LabConnectionTest, logsOutAndInAsSomebodyElse) {
  server_.addUser("bert", pb::CURRICULUM_MANAGER, "correct horse battery");
  LabConnection lab(quick());
  lab.logIn(login());
  ASSERT_TRUE(untilPhase(lab, LinkPhase::kOnline));
  lab.logOut();
  EXPECT_EQ(lab.state().phase, LinkPhase::kLoggedOut);
  lab.logIn(login("bert"));
  ASSERT_TRUE(until(lab, [&] {
    return lab.state().phase == LinkPhase::kOnline && lab.state().role == pb::CURRICULUM_MANAGER;
  }));
}

TEST_F(LabConnectionTest, anAccountThatIsDisabledEndsTheConnectionInWords) {
  LabConnection lab(quick());
  lab.logIn(login());
  ASSERT_TRUE(untilPhase(lab, LinkPhase::kOnline));
  auto admin = server_.connect(personLogin("anna", "correct horse battery"));
  ASSERT_TRUE(admin.ok());
  server_.addUser("root", pb::ADMINISTRATOR, "correct horse battery");
  auto root = server_.connect(personLogin("root", "correct horse battery"));
  ASSERT_TRUE(root.ok());
  pb::Request request;
  request.mutable_disable_user()->set_name("anna");
  ASSERT_TRUE(root->call(request).ok());
  ASSERT_TRUE(untilPhase(lab, LinkPhase::kRefused));
  EXPECT_THAT(lab.state().trouble.todo, HasSubstr("disabled"));
}

TEST_F(LabConnectionTest, workersCallAndWait) {
  LabConnection lab(quick());
  lab.logIn(login());
  std::optional<Result<pb::Reply>> reply;
  std::thread worker([&] { reply.emplace(lab.call(listStations())); });
  worker.join();
  ASSERT_TRUE(reply && reply->ok());
  // A request without an answer can be cancelled.
  (void)server_.stop();
  std::atomic<bool> stop{false};
  std::thread waits([&] { reply.emplace(lab.call(listStations(), [&] { return stop.load(); })); });
  stop = true;
  waits.join();
  EXPECT_FALSE(reply->ok());
}

TEST_F(LabConnectionTest, unreadFramesAreDroppedAndCounted) {
  auto settings = quick();
  settings.max_frames = 10;
  LabConnection lab(settings);
  lab.watch("bench-1");
  lab.logIn(login());
  auto station = server_.connect(stationLogin("bench-1", key_));
  ASSERT_TRUE(station.ok());
  (void)waitFor(*station, [](const auto& e) { return e.has_watch_state() && e.watch_state().watched(); });
  const FakeSession session("bench-1");
  ASSERT_TRUE(station->send(session.open()).ok());
  for (std::uint64_t n = 0; n < 50; ++n) {
    pb::Envelope frame;
    const Bytes data = FakeSession::bytes(n);
    frame.mutable_live_frame()->set_session_id(session.id());
    frame.mutable_live_frame()->set_frame_seq(n);
    frame.mutable_live_frame()->set_data(data.data(), data.size());
    ASSERT_TRUE(station->send(frame).ok());
    (void)station->receive(milliseconds(2)).ok();
  }
  EXPECT_TRUE(eventually([&] { return lab.state().frames_dropped > 0; }));
  // the newest ones are kept
  const auto news = lab.poll();
  EXPECT_LE(news.frames.size(), 10u);
  ASSERT_FALSE(news.frames.empty());
  const LinkState state = lab.state();
  EXPECT_GT(state.frames_dropped, 0u);
  for (std::size_t i = 1; i < news.frames.size(); ++i)
    EXPECT_GT(news.frames[i].frame.frame_seq(), news.frames[i - 1].frame.frame_seq());
}

}  // namespace
}  // namespace needlelab
