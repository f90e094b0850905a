// The live page: tiles over a WebSocket.
#include <atomic>
#include <chrono>
#include <thread>
#include <utility>

#include "common/base/files/files.h"
#include "tests/support/patience.h"
#include "tests/support/time/fake_time.h"
#include "tests/unit/server/web/web_lab.h"

namespace needlelab {
namespace {

using namespace test;
using nlohmann::json;

pb::Login ofStation(const std::string& key) {
  pb::Login login;
  login.mutable_station()->set_station("bench");
  login.mutable_station()->set_key(key);
  return login;
}

json tileOf(const std::string& text, const std::string& station) {
  const json all = json::parse(text, nullptr, false);
  if (!all.is_object()) return nullptr;
  for (const json& tile : all["tiles"])
    if (tile["station"] == station) return tile;
  return nullptr;
}

TEST(WebLive, aViewerThatNeverReadsDelaysNoOtherViewer) {
  WebLab lab;
  Browser ada = lab.browserOf("ada");
  ASSERT_EQ(askChecked(ada, "PATCH", "/api/v1/people/tina", R"({"full_name": "Tina Maier"})",
                       {{"Origin", "https://localhost"}, {"If-Match", "\"1\""}})
                .status,
            200);
  auto station = lab.server().connect(ofStation(lab.stationKey()));
  ASSERT_TRUE(station.ok());
  const FakeSession session("bench");
  ASSERT_TRUE(station->send(session.open()).ok());
  (void)waitFor(*station, [](const pb::Envelope& e) { return e.has_session_opened(); });
  Browser ines = lab.browserOf("ines"), mara = lab.browserOf("mara");
  const json sessions = askChecked(ines, "GET", "/api/v1/sessions").json();
  EXPECT_EQ(sessions["items"][0]["description"]["trainee_full_name"], "Tina Maier");
  const auto first = ines.live(), second = mara.live(), silent = ines.live();
  ASSERT_TRUE(first && second && silent);
  pb::Envelope envelope;
  auto& status = *envelope.mutable_station_status();
  status.set_trainee("tina");
  status.set_exercise_id("knee");
  status.set_session_id(session.id());
  status.set_insertion_m(0.012);
  status.set_phase(1);
  for (const double force : {1.5, 2.5, 0.5}) {
    status.set_force_n(force);
    const Status sent = station->send(envelope);
    ASSERT_TRUE(sent.ok()) << sent.error().message;
    (void)station->receive(milliseconds(50));  // it sends while it waits
    for (const auto* viewer : {&first, &second}) {
      json tile;
      for (int i = 0; i < 50 && (tile.is_null() || tile["force_n"] != force); ++i) {
        const auto text = (*viewer)->readText();
        ASSERT_TRUE(text.has_value());
        EXPECT_EQ(json::parse(*text)["live_trouble"], "") << "the lab has one server";
        tile = tileOf(*text, "bench");
      }
      EXPECT_EQ(tile["force_n"], force);
      EXPECT_EQ(tile["peak_force_n"], std::max(force, force == 0.5 ? 2.5 : force));
      EXPECT_EQ(tile["online"], true);
      EXPECT_EQ(tile["trainee"], "tina");
      EXPECT_EQ(tile["trainee_full_name"], "Tina Maier");
      EXPECT_EQ(tile["phase"], "going in");
    }
  }
}

TEST(WebLive, theLayerHasTheNameOfTheSessionsProfile) {
  WebLab lab;
  auto station = lab.server().connect(ofStation(lab.stationKey()));
  ASSERT_TRUE(station.ok());
  const auto profile = readWholeFile(NEEDLELAB_SOURCE_DIR "/db/samples/lumbar-adult.json");
  ASSERT_TRUE(profile.ok());
  const FakeSession session("bench");
  ASSERT_TRUE(station->send(session.open(*profile)).ok());
  (void)waitFor(*station, [](const pb::Envelope& e) { return e.has_session_opened(); });
  pb::Envelope envelope;
  auto& status = *envelope.mutable_station_status();
  status.set_session_id(std::string(session.id().begin(), session.id().end()));
  Browser ines = lab.browserOf("ines");
  const auto viewer = ines.live();
  ASSERT_TRUE(viewer);
  const std::pair<int, const char*> cases[] = {
      {0, "skin"}, {3, "ligamentum flavum"}, {4, "epidural space"}, {-1, ""}, {99, ""}};
  for (const auto& [layer, name] : cases) {
    status.set_layer(layer);
    status.set_force_n(layer + 10);
    ASSERT_TRUE(station->send(envelope).ok());
    (void)station->receive(milliseconds(50));  // it sends while it waits
    json tile;
    // a tile has no name until the board has read the session's profile
    for (int i = 0; i < 50 && (tile.is_null() || tile["force_n"] != layer + 10 || tile["layer"] != name);
         ++i) {
      const auto text = viewer->readText();
      ASSERT_TRUE(text.has_value());
      tile = tileOf(*text, "bench");
    }
    EXPECT_EQ(tile["force_n"], layer + 10);
    EXPECT_EQ(tile["layer"], name) << layer;
  }
}

TEST(WebLive, whoDoesNotReadIsCutWhenItsBufferIsFull) {
  WebLab lab([](ServerOptions& options) {
    options.web.live_period = milliseconds(10);
    // longer than a busy machine delays the reader
    options.web.live_write_timeout = milliseconds(3000);
    options.web.live_idle_timeout = std::chrono::hours(1);  // it stays silent until its buffer is full
    options.metrics = "127.0.0.1:0";
  });
  // updates of about 10 KB
  for (int i = 0; i < 50; ++i)
    (void)lab.server().addStation("a bench with a long name, number " + std::to_string(i));
  Browser ines = lab.browserOf("ines");
  const auto reading = ines.live(), silent = ines.live();
  ASSERT_TRUE(reading && silent);
  silent->keepLittle();
  std::string metrics;
  const auto dropped = [&] {
    WebWire wire(lab.server().server().metricsPort(), false);
    (void)wire.sendPlain("GET /metrics HTTP/1.1\r\nHost: x\r\n\r\n");
    metrics = wire.receivePlain();
    return metrics.find("needlelab_web_live_dropped_total 1\n") != std::string::npos;
  };
  // reads all the time: it must not be disturbed when it takes longer than the timeout
  std::atomic<bool> over{false}, broken{false};
  std::atomic<int> texts{0};
  std::thread reader([&] {
    while (!over && !broken) {
      if (reading->readText().has_value())
        ++texts;
      else
        broken = true;
    }
  });
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(300);  // only ends a hang
  const auto until = [&](auto holds) {
    while (!holds() && !broken && std::chrono::steady_clock::now() < end)
      std::this_thread::sleep_for(milliseconds(500));  // a request costs the server more than a text
    return holds();
  };
  EXPECT_TRUE(until(dropped)) << texts << " texts read; the server says:\n" << metrics;
  const int texts_at_the_cut = texts;
  EXPECT_TRUE(until([&] { return texts > texts_at_the_cut + 5; })) << "the other viewer continues";
  over = true;
  reader.join();
  EXPECT_FALSE(broken);
}

TEST(WebLive, comesFiveTimesASecondUnlessConfigured) {
  EXPECT_EQ(ServerOptions().web.live_period, milliseconds(200));
  // Neither server depends on the machine's speed: one has nothing to send for an hour, the other always has
  // something.
  WebLab rare([](ServerOptions& options) { options.web.live_period = std::chrono::hours(1); });
  WebLab often([](ServerOptions& options) { options.web.live_period = milliseconds(10); });
  const auto waiting = rare.browserOf("ines").live(), viewer = often.browserOf("ines").live();
  ASSERT_TRUE(waiting && viewer);
  ASSERT_TRUE(waiting->readText().has_value()) << "the first comes at once";
  for (int i = 0; i < 10; ++i) ASSERT_TRUE(viewer->readText().has_value());
  EXPECT_FALSE(waiting->readText(milliseconds(100)).has_value());
}

TEST(WebLive, needsALogInAndAPageOfThisServer) {
  WebLab lab;
  Browser ines = lab.browserOf("ines"), tina = lab.browserOf("tina"), nobody = lab.browser();
  WebReply refused;
  EXPECT_EQ(nobody.live(&refused), nullptr);
  EXPECT_EQ(refused.status, 401);
  EXPECT_EQ(tina.live(&refused), nullptr);
  EXPECT_EQ(refused.status, 403);
  EXPECT_EQ(ines.live(&refused, "https://evil"), nullptr);
  EXPECT_EQ(refused.status, 403);
  EXPECT_EQ(ines.live(&refused, ""), nullptr);
  EXPECT_EQ(refused.status, 403);
  EXPECT_EQ(
      fits("GET", "/api/v1/live", ines.ask("GET", "/api/v1/live", "", {{"Origin", "https://localhost"}}))
          .status,
      426);
  EXPECT_NE(ines.live(), nullptr);
}

TEST(WebLive, endsWithItsSession) {
  WebLab lab;
  Browser ines = lab.browserOf("ines"), mara = lab.browserOf("mara");
  const auto logged_out = ines.live(), disabled = mara.live();
  ASSERT_TRUE(logged_out && disabled);
  EXPECT_EQ(ines.ask("DELETE", "/api/v1/session").status, 200);
  while (logged_out->readText().has_value()) {
  }
  EXPECT_EQ(logged_out->closeCode(), 1008);
  Browser ada = lab.browserOf("ada");
  EXPECT_EQ(ada.ask("PATCH", "/api/v1/people/mara", R"({"disabled": true})", {{"If-Match", "\"1\""}}).status,
            200);
  while (disabled->readText().has_value()) {
  }
  EXPECT_EQ(disabled->closeCode(), 1008);
}

TEST(WebLive, lastsAsLongAsSomeoneWatches) {
  FakeTime time;
  WebLab lab([&](ServerOptions& options) { options.token_time = &time; });
  Browser ines = lab.browserOf("ines"), mara = lab.browserOf("mara");
  const auto looked_at = ines.live(), left_open = mara.live();
  ASSERT_TRUE(looked_at && left_open);
  // requests do not extend the session
  const auto left_min = [](Browser& browser) {
    return (browser.get("/api/v1/session").json()["expires_unix_ms"].get<double>() -
            static_cast<double>(wallNowNs()) / 1e6) /
           60e3;
  };
  for (int look = 0; look < 3; ++look) {
    ASSERT_TRUE(looked_at->sendFrame(1, "looked at"));
    ASSERT_TRUE(eventually([&] { return left_min(ines) > 10; })) << look;
    time.advance(std::chrono::nanoseconds(std::chrono::minutes(7)).count());
    if (look == 1) {
      EXPECT_LT(left_min(mara), 2) << "no one has looked for 14 minutes";
    }
  }
  EXPECT_EQ(ines.get("/api/v1/session").status, 200) << "after 21 minutes";
  EXPECT_TRUE(looked_at->readText().has_value());
  while (left_open->readText().has_value()) {
  }
  EXPECT_EQ(left_open->closeCode(), 1008);
  EXPECT_EQ(mara.get("/api/v1/session").status, 401);
}

TEST(WebLive, endsWithTheServer) {
  WebLab lab;
  const auto viewer = lab.browserOf("ines").live();
  ASSERT_TRUE(viewer);
  (void)viewer->readText();
  std::thread stopping([&] { (void)lab.server().stop(); });
  while (viewer->readText().has_value()) {
  }
  EXPECT_EQ(viewer->closeCode(), 1001);
  stopping.join();
}

TEST(WebLive, aPersonHasItsNumberOfPagesAndTheyAreCountedBack) {
  WebLab lab([](ServerOptions& options) { options.web.live_sockets_per_person = 2; });
  Browser ines = lab.browserOf("ines");
  auto first = ines.live(), second = ines.live();
  ASSERT_TRUE(first && second);
  WebReply refused;
  EXPECT_EQ(ines.live(&refused), nullptr);
  EXPECT_EQ(refused.status, 429);
  first.reset();
  EXPECT_TRUE(eventually([&] { return ines.live() != nullptr; }));
}

TEST(WebLive, whoSendsMoreThanItShouldIsEnded) {
  WebLab lab;
  const auto viewer = lab.browserOf("ines").live();
  ASSERT_TRUE(viewer);
  EXPECT_TRUE(viewer->sendFrame(1, "hello"));
  EXPECT_TRUE(viewer->readText().has_value());
  (void)viewer->sendFrame(1, std::string(5000, 'x'));
  int more = 0;
  while (viewer->readText().has_value() && more < 100) ++more;
  EXPECT_LT(more, 100);
}

}  // namespace
}  // namespace needlelab
