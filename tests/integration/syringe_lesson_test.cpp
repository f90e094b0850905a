// The injection, from the plunger to the database: real programs over TLS on loopback.
#include <gmock/gmock.h>

#include <cmath>
#include <fstream>

#include "common/base/files/files.h"
#include "common/base/program.h"
#include "tests/integration/lab.h"

namespace needlelab::test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
using Json = nlohmann::json;

// in by 1 s, 4 s of rest 24 mm under the skin of a ball at `0.4,-0.1,0.045`, out again; the plunger is drawn
// back from 1.5 s to 2 s and pressed from 2.5 s to 4 s
std::string recordedInjection() {
  std::string text = "t_s,px_m,py_m,pz_m,qx,qy,qz,qw,plunger\n";
  for (int k = 0; k <= 6000; ++k) {
    const double t = 0.001 * k;
    const double out = t < 1 ? 1 - t : t < 5 ? 0 : t - 5;
    const double plunger = t < 1.5   ? 0.2
                           : t < 2   ? 0.2 - 0.2 * (t - 1.5)
                           : t < 2.5 ? 0.1
                           : t < 4   ? 0.1 + 0.5 * (t - 2.5)
                                     : 0.85;
    char line[200];
    std::snprintf(line, sizeof line, "%.3f,0.4,-0.1,%.9g,1,0,0,0,%.9g\n", t, 0.021 + 0.03 * out, plunger);
    text += line;
  }
  return text;
}

class SyringeLessonTest : public testing::Test {
 protected:
  // the output of needlelab-admin for the stopped server's folder
  Json storedEvents(const std::string& id) const {
    const auto file = lab_.path("events.json");
    EXPECT_EQ(lab_.admin({"session", "events", id, "--json", file.string()}), kExitDone);
    const auto text = readWholeFile(file);
    return text.ok() ? Json::parse(*text).at("rows") : Json();
  }
  static double measure(const Json& summary, const std::string& name) {
    for (const Json& row : summary.at("score"))
      if (row.at("measure") == name) return row.at("value");
    return std::nan("");
  }
  Lab lab_;
};

TEST_F(SyringeLessonTest, aRecordingsPlungerBecomesStoredEventsWithPlaceAndTime) {
  lab_.startServer();
  const std::string file = lab_.path("injection.csv").string();
  std::ofstream(file) << recordedInjection();
  auto station = lab_.startStation("station", {"--exercise", "ball-free-practice", "--device",
                                               "recording:" + file, "--placement", "0.4,-0.1,0.045,0,0,0,1"});
  ASSERT_EQ(station->wait(), kExitDone) << station->said();
  const Json summary = lab_.summary("station");
  ASSERT_TRUE(summary.is_object()) << station->said();

  const Json events = summary.at("syringe");
  ASSERT_EQ(events.size(), 2u) << events;
  EXPECT_EQ(events[0].at("event"), "ASPIRATION");
  EXPECT_NEAR(events[0].at("begin_s").get<double>(), 1.5, 0.03);
  EXPECT_NEAR(events[0].at("end_s").get<double>(), 2, 0.03);
  EXPECT_EQ(events[1].at("event"), "INJECTION");
  EXPECT_NEAR(events[1].at("begin_s").get<double>(), 2.5, 0.03);
  EXPECT_NEAR(events[1].at("end_s").get<double>(), 4, 0.03);
  EXPECT_NEAR(events[1].at("plunger_to").get<double>(), 0.85, 0.001);
  // the ball's needle: 21G, bevel of 0.3 rad; the tip is 24 mm deep, the target's centre 25 mm
  const double behind = 0.0008 / (2 * std::tan(0.3));
  const Json& place = events[1].at("begin");
  EXPECT_NEAR(place.at("depth_m").get<double>(), 0.024 - behind, 2e-6);
  EXPECT_NEAR(place.at("z_m").get<double>(), 0.021 + behind, 2e-6);
  EXPECT_EQ(place.at("layer"), 1);
  EXPECT_NEAR(place.at("target_distance_m").get<double>(), 0.001 + behind - 0.003, 2e-6);
  EXPECT_EQ(events[1].at("in_target_share"), 1);
  EXPECT_THAT(station->said(), HasSubstr("injection of 75 % at 2.5 s"));
  EXPECT_EQ(measure(summary, "aspirated_before_injection"), 1);
  EXPECT_NEAR(measure(summary, "injected_in_target_share"), 1, 1e-9);

  // the server computed the same from its committed data
  EXPECT_EQ(lab_.stopServer(), kExitDone);
  EXPECT_EQ(storedEvents(summary.at("session_id")), events);
}

}  // namespace
}  // namespace needlelab::test
