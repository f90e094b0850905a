#include "client/instructor/terminal/headless.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <climits>
#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string_view>
#include <thread>

#include "tests/support/time/fake_time.h"
#include "tests/unit/server/live/running_server.h"

namespace needlelab {
namespace {

using namespace test;
using testing::HasSubstr;

/// The command's output so far, for a test that reacts to it.
class Printed : public std::stringbuf {
 public:
  [[nodiscard]] bool waits() const { return waits_; }
  [[nodiscard]] int updates() const { return updates_; }

 protected:
  std::streamsize xsputn(const char* text, std::streamsize size) override {
    const std::string_view line(text, static_cast<std::size_t>(size));
    if (line.find("not online: waiting") != line.npos) waits_ = true;
    if (line.find("\"update\"") != line.npos) ++updates_;
    return std::stringbuf::xsputn(text, size);
  }

 private:
  std::atomic<bool> waits_{false};
  std::atomic<int> updates_{0};
};

class Headless : public testing::Test {
 protected:
  Printed printed_;
  int enough_updates_ = INT_MAX;  ///< ends a run
  RunningServer server_;
  std::string key_ = server_.addStation("bench-1");
  InstructorOptions options_;
  Endpoints others_;  ///< further servers beside ours

  void SetUp() override {
    server_.addUser("anna", pb::INSTRUCTOR, "correct horse battery");
    options_.json = true;
    options_.user = "anna";
  }

  struct Output {
    Status status;
    std::vector<nlohmann::json> updates, notes;
    nlohmann::json summary;
  };
  Output run(double seconds, TimeSource& time = machineTime()) {
    auto config = server_.config({});
    if (!others_.empty()) config.others = others_;
    options_.server = endpointsText(config.servers());
    config.login = personLogin("anna", "correct horse battery");
    auto client = BlockingClient::connect(config);
    if (!client.ok()) return {client.error(), {}, {}, {}};
    printed_.str({});
    std::ostream text(&printed_);
    const std::int64_t end_ns = client->nowNs() + std::llround(seconds * 1e9);
    Output output;
    output.status = runHeadless(
        {options_, *client, text, [this] { return printed_.updates() >= enough_updates_; }, end_ns, time});
    std::istringstream lines(printed_.str());
    for (std::string line; std::getline(lines, line);) {
      auto json = nlohmann::json::parse(line);
      if (json["type"] == "update")
        output.updates.push_back(std::move(json));
      else if (json["type"] == "note")
        output.notes.push_back(std::move(json));
      else
        output.summary = std::move(json);
    }
    return output;
  }

  /// Opens a session, and sends a frame of 20 samples every 20 ms while an instructor watches it.
  void playStation(const FakeSession& session, std::atomic<bool>& stop,
                   std::vector<std::string>* heard = nullptr) {
    auto client = server_.connect(stationLogin("bench-1", key_));
    ASSERT_TRUE(client.ok());
    ASSERT_TRUE(client->send(session.open()).ok());
    std::uint64_t n = 0;
    bool watched = false;
    auto due = std::chrono::steady_clock::now();
    while (!stop) {
      due += milliseconds(20);
      for (auto left = due - std::chrono::steady_clock::now(); left.count() > 0;
           left = due - std::chrono::steady_clock::now()) {
        const auto got = client->receive(std::chrono::ceil<milliseconds>(left));
        if (!got.ok()) continue;
        if (got->has_watch_state()) watched = got->watch_state().watched();
        if (got->has_trainee_message() && heard != nullptr) heard->push_back(got->trainee_message().text());
      }
      if (!watched) continue;
      std::vector<GestureSample> samples(20);
      for (std::size_t i = 0; i < samples.size(); ++i) {
        samples[i].tick = n * 20 + i;
        samples[i].time_ns = 1'000'000'000 + static_cast<std::int64_t>(samples[i].tick) * 1'000'000;
        samples[i].force_W_N[0] = 2;
        samples[i].phase = 1;
      }
      const Bytes data = encodeChunk(Resolution::standard(), samples);
      pb::Envelope frame;
      frame.mutable_live_frame()->set_session_id(session.id());
      frame.mutable_live_frame()->set_frame_seq(n++);
      frame.mutable_live_frame()->set_data(data.data(), data.size());
      frame.mutable_live_frame()->set_capture_unix_ns(wallNowNs());
      ASSERT_TRUE(client->send(frame).ok());
    }
  }
};

TEST_F(Headless, watchingWaitsForAStationToComeOnline) {
  options_.station = "bench-1";
  options_.rate_hz = 0;
  options_.message = "slower, please";
  FakeSession session("bench-1");
  std::atomic<bool> stop{false};
  std::vector<std::string> heard;
  std::thread station([&] {
    while (!printed_.waits() && !stop) std::this_thread::sleep_for(milliseconds(1));
    playStation(session, stop, &heard);
  });
  enough_updates_ = 12;
  const auto output = run(60);  // ends long before this
  stop = true;
  station.join();
  ASSERT_TRUE(output.status.ok()) << output.status.error().message;
  ASSERT_GE(output.notes.size(), 2u);
  EXPECT_THAT(output.notes[0]["text"], HasSubstr("not online: waiting"));
  EXPECT_THAT(output.notes[1]["text"], HasSubstr("is online"));
  EXPECT_EQ(heard, std::vector<std::string>{"slower, please"});
  ASSERT_GT(output.updates.size(), 10u);
  const auto& update = output.updates.back();
  EXPECT_EQ(update["station"], "bench-1");
  EXPECT_EQ(update["trainee"], "tina");
  EXPECT_EQ(update["phase"], "going in");
  EXPECT_NEAR(update["force_n"], 2, 1e-3);
  // counted from the first sample, tick 0, whatever the station's clock said then: a frame's last tick is 20
  // n + 19
  const double newest_tick = update["time_s"].get<double>() * 1000;
  EXPECT_NEAR(std::fmod(newest_tick, 20), 19, 1e-6);
  EXPECT_GE(newest_tick, 20.0 * static_cast<double>(output.updates.size()) - 1 - 1e-6);
  EXPECT_EQ(output.summary["frames"], output.updates.size());
  EXPECT_EQ(output.summary["samples"], 20 * output.updates.size());
  EXPECT_EQ(output.summary["dropped"], 0);
  EXPECT_GT(output.summary["live_p99_ms"], 0.0);
}

TEST_F(Headless, theMessageIsSentOnceAndThenItEnds) {
  options_.station = "bench-1";
  options_.message = "well done";
  options_.rate_hz = 0;
  options_.once = true;
  FakeSession session("bench-1");
  std::atomic<bool> stop{false};
  std::vector<std::string> heard;
  std::thread station([&] { playStation(session, stop, &heard); });
  const auto output = run(60);  // ends long before this
  stop = true;
  station.join();
  ASSERT_TRUE(output.status.ok()) << output.status.error().message;
  EXPECT_EQ(heard, std::vector<std::string>{"well done"});
  ASSERT_FALSE(output.notes.empty());
  EXPECT_EQ(output.notes.back()["text"], "message sent");
}

TEST_F(Headless, anUndeliveredMessageFailsTheCommand) {
  options_.station = "bench-1";
  options_.message = std::string(5000, 'x');
  options_.once = true;
  FakeSession session("bench-1");
  std::atomic<bool> stop{false};
  std::thread station([&] { playStation(session, stop); });
  auto output = run(60);
  stop = true;
  station.join();
  ASSERT_FALSE(output.status.ok());
  EXPECT_EQ(output.status.error().code, ErrorCode::kInvalidInput);
  ASSERT_FALSE(output.notes.empty());
  EXPECT_THAT(output.notes.back()["text"], testing::StartsWith("message: "));
  // no station is connected
  options_.message = "hello";
  output = run(0.3);
  ASSERT_FALSE(output.status.ok());
  EXPECT_EQ(output.status.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(output.status.error().message, HasSubstr("the station was not online"));
}

TEST_F(Headless, theRateIsLinesPerSecond) {
  options_.station = "bench-1";
  options_.rate_hz = 10;
  FakeSession session("bench-1");
  std::atomic<bool> stop{false};
  std::thread station([&] { playStation(session, stop); });
  const auto output = run(1.5);
  stop = true;
  station.join();
  EXPECT_GE(output.updates.size(), 5u);
  EXPECT_LE(output.updates.size(), 17u);
  EXPECT_EQ(output.summary["samples"], output.updates.size());
}

TEST_F(Headless, withSeveralServersTheAnsweringOneIsNamed) {
  others_ = {{"127.0.0.1", 1}};
  const auto output = run(0.1);
  ASSERT_TRUE(output.status.ok()) << output.status.error().message;
  ASSERT_EQ(output.notes.size(), 1u);
  EXPECT_EQ(output.notes[0]["text"], "connected to 127.0.0.1:" + std::to_string(server_.server().port()));
  others_.clear();
  EXPECT_TRUE(run(0.1).notes.empty()) << "the only one needs no name";
}

TEST_F(Headless, theOverviewShowsAllStations) {
  server_.addStation("bench-2");
  auto station = server_.connect(stationLogin("bench-1", key_));
  ASSERT_TRUE(station.ok());
  const auto output = run(0.4);
  ASSERT_TRUE(output.status.ok());
  std::map<std::string, bool> online;
  for (const auto& update : output.updates) online[update["station"]] = update["online"];
  EXPECT_EQ(online, (std::map<std::string, bool>{{"bench-1", true}, {"bench-2", false}}));
}

TEST_F(Headless, aStoredSessionReplaysInRealTimeWithAnnotations) {
  FakeSession session("bench-1");
  auto station = server_.connect(stationLogin("bench-1", key_));
  ASSERT_TRUE(station.ok());
  ASSERT_TRUE(station->send(session.open()).ok());
  for (std::uint64_t seq = 0; seq < 10; ++seq) ASSERT_TRUE(station->send(session.chunk(seq)).ok());
  session.waitForAck(*station, 10);
  pb::Request annotate;
  annotate.mutable_annotate()->set_session_id(session.id());
  annotate.mutable_annotate()->set_tick(500);
  annotate.mutable_annotate()->set_text("here it slipped");
  server_.asAdmin(annotate);

  Uuid id{};
  std::copy(session.id().begin(), session.id().end(), id.begin());
  options_.session = uuidText(id);
  options_.replay = true;
  FakeTime time;
  const std::int64_t began_ns = time.nowNs();
  const auto paced = run(30, time);
  ASSERT_TRUE(paced.status.ok()) << paced.status.error().message;
  // 1,000 samples at 1 kHz: one second, ten lines, the last after 0.9 s
  EXPECT_NEAR(1e-9 * static_cast<double>(time.nowNs() - began_ns), 0.9, 0.0011);
  EXPECT_EQ(paced.updates.size(), 10u);
  EXPECT_EQ(paced.summary["samples"], 1000);
  for (std::size_t i = 0; i < paced.updates.size(); ++i)
    EXPECT_NEAR(paced.updates[i]["time_s"], 0.1 * static_cast<double>(i), 0.0011);
  ASSERT_EQ(paced.notes.size(), 2u);
  EXPECT_THAT(paced.notes[1]["text"], HasSubstr("here it slipped"));

  options_.speed = 2;
  const std::int64_t faster_ns = time.nowNs();
  EXPECT_EQ(run(30, time).updates.size(), 10u);
  EXPECT_NEAR(1e-9 * static_cast<double>(time.nowNs() - faster_ns), 0.45, 0.0011);

  options_.speed = 0;
  options_.rate_hz = 0;
  const std::int64_t at_once_ns = time.nowNs();
  EXPECT_EQ(run(30, time).updates.size(), 1000u);
  EXPECT_EQ(time.nowNs(), at_once_ns);
}

TEST_F(Headless, aSessionThatIsNotThereIsNotFound) {
  options_.session = uuidText(makeUuidV7());
  options_.replay = true;
  const auto output = run(5);
  ASSERT_FALSE(output.status.ok());
  EXPECT_EQ(output.status.error().code, ErrorCode::kNotFound);
}

}  // namespace
}  // namespace needlelab
