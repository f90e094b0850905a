// Errors in a script, and their messages.
#include "tests/unit/client/instructor/screens/window_lab.h"

#include "tests/unit/client/instructor/model/upload_lesson.h"

namespace needlelab {
namespace {

using namespace test;
using testing::HasSubstr;

using ScriptRunnerTest = WindowLab;

TEST_F(ScriptRunnerTest, theFailingLineIsNamed) {
  EXPECT_THAT(script("print hello\nexpect \"no such words\"").error().message,
              HasSubstr("script:2: expect \"no such words\": does not stand there"));
  EXPECT_EQ(printed_, std::vector<std::string>{"hello"});
  frame_s_ = 0.125;
  EXPECT_THAT(script("timeout 0.2\nwait-station bench-9").error().message, HasSubstr("not so within 0.2 s"));
  EXPECT_THAT(script("pause").error().message, HasSubstr("open one first"));
  EXPECT_THAT(script("seek 1").error().message, HasSubstr("no session is loaded"));
  EXPECT_THAT(script("latency").error().message, HasSubstr("open one first"));
  lab_->form.password = "wrong";
  EXPECT_THAT(script("login").error().message, HasSubstr("name and password"));
}

TEST_F(ScriptRunnerTest, quitEndsAndWaitingLetsTimeGoBy) {
  const std::int64_t began_ns = steadyNowNs();
  EXPECT_TRUE(script("wait 0.3\nquit\nexpect \"never come to\"").ok());
  EXPECT_GE(steadyNowNs() - began_ns, 290'000'000);
}

TEST_F(ScriptRunnerTest, latencyIsMeasuredAndJudged) {
  BenchStation bench(server_, "bench-1", server_.addStation("bench-1"), "tina");
  const Status done =
      script("login\nwait-station bench-1 lesson\nopen station bench-1\nwait-live 3\nlatency 100000\nframes");
  ASSERT_TRUE(done.ok()) << done.error().message;
  ASSERT_EQ(printed_.size(), 2u);
  EXPECT_THAT(printed_[0], HasSubstr("capture to screen: p50"));
  EXPECT_THAT(script("latency 0.001").error().message, HasSubstr("p99 is"));
}

TEST_F(ScriptRunnerTest, liveFramesAreCountedFromTheActionOn) {
  EXPECT_THAT(script("wait-live 1").error().message, HasSubstr("open one first"));
  BenchStation bench(server_, "bench-1", server_.addStation("bench-1"), "tina");
  ASSERT_TRUE(script("login\nwait-station bench-1 lesson\nopen station bench-1\nwait-live 3").ok());
  const std::size_t before = lab_->live()->latency().count();
  EXPECT_GE(before, 3u);
  ASSERT_TRUE(script("wait-live 4").ok());
  EXPECT_GE(lab_->live()->latency().count(), before + 4);
}

TEST_F(ScriptRunnerTest, aReplayIsWaitedForOnlyWhereOneIs) {
  EXPECT_THAT(script("wait-replay 1").error().message, HasSubstr("replay one first"));
}

TEST_F(ScriptRunnerTest, aFilterReplacesTheOneBeforeAndShowsTheLab) {
  (void)server_.addStation("bench-1");
  (void)server_.addStation("bench-2");
  ASSERT_TRUE(script("login\nwait-station bench-2 offline\nsessions").ok());
  struct Row {
    const char* word;
    TileFilter filter;
  };
  const Row rows[] = {{"bench-2", {.text = "bench-2"}}, {"online", {.only_online = true}}, {"all", {}}};
  for (const Row& row : rows) {
    lab_->screen = WindowScreen::kSessions;
    ASSERT_TRUE(script("filter " + std::string(row.word)).ok()) << row.word;
    EXPECT_EQ(lab_->screen, WindowScreen::kLab) << row.word;
    EXPECT_EQ(lab_->filter.text, row.filter.text) << row.word;
    EXPECT_EQ(lab_->filter.only_online, row.filter.only_online) << row.word;
  }
}

TEST_F(ScriptRunnerTest, openFirstLooksOverTheFirstTileThatIsShown) {
  (void)server_.addStation("bench-1");
  (void)server_.addStation("bench-2");
  ASSERT_TRUE(script("login\nwait-station bench-2 offline\nfilter bench-2\nopen-first").ok());
  ASSERT_NE(lab_->live(), nullptr);
  EXPECT_EQ(lab_->live()->station(), "bench-2");
  EXPECT_EQ(lab_->screen, WindowScreen::kLive);
  // the script waits for a station that is not there
  frame_s_ = 0.125;
  EXPECT_THAT(script("timeout 0.2\nopen station bench-9").error().message, HasSubstr("not so within 0.2 s"));
  EXPECT_EQ(lab_->live()->station(), "bench-2");
}

TEST_F(ScriptRunnerTest, aStateThatNoStationHasIsNamed) {
  (void)server_.addStation("bench-1");
  EXPECT_THAT(script("login\nwait-station bench-1 offline\nwait-station bench-1 asleep").error().message,
              HasSubstr("script:3: wait-station \"bench-1\" \"asleep\": a station is online, offline, in a "
                        "lesson, or needs help; not 'asleep'"));
}

TEST_F(ScriptRunnerTest, helpOpensAndClosesAndLettersTakeTheirScale) {
  ASSERT_TRUE(script("login\nhelp\nwait-text Keyboard\nhelp\nwait-gone Keyboard\nfont-scale 1.5").ok());
  EXPECT_DOUBLE_EQ(surface_->fontScale(), 1.5);
}

TEST_F(ScriptRunnerTest, timesOfAReplayCountFromTheSessionsBeginning) {
  const std::string key = server_.addStation("bench-1");
  const std::string profile = sampleProfile("shoulder-adult");
  uploadLesson(server_, key, lessonInfo(profile), lessonSamples(profile, {.depth_m = 0.02, .seconds = 1}));
  const Status loaded = script("login\nreplay newest");
  ASSERT_TRUE(loaded.ok()) << loaded.error().message;
  const ReplayPlayer& player = lab_->analysis.player;
  ASSERT_GT(player.last_s(), player.first_s() + 0.7);
  ASSERT_TRUE(script("seek 0.5").ok());
  EXPECT_DOUBLE_EQ(player.at_s(), player.first_s() + 0.5);
  ASSERT_TRUE(script("step -2").ok());
  EXPECT_NEAR(player.at_s(), player.first_s() + 0.48, 1e-9);
  ASSERT_TRUE(script("speed 4\nloop 0.25 0.75").ok());
  EXPECT_EQ(player.speed(), 4);
  ASSERT_TRUE(player.loop());
  EXPECT_DOUBLE_EQ(player.loop()->from_s, player.first_s() + 0.25);
  EXPECT_DOUBLE_EQ(player.loop()->to_s, player.first_s() + 0.75);
  ASSERT_TRUE(script("loop off").ok());
  EXPECT_FALSE(player.loop());
  EXPECT_FALSE(player.playing()) << "nothing of this plays";
}

}  // namespace
}  // namespace needlelab
