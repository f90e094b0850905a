#include "client/instructor/model/live/live_station.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "tests/support/scenes/stored_sample.h"
#include "tests/unit/client/instructor/model/lesson_frame.h"
#include "tests/unit/client/instructor/model/lesson_gestures.h"

namespace needlelab {
namespace {

class LiveStationTest : public testing::Test {
 protected:
  /// Feeds frames of 20 samples, [from, to).
  void feed(std::size_t from, std::size_t to) {
    for (std::size_t k = from; k < to; k += 20) {
      LiveArrival arrival = test::lessonFrame(info_, samples_, k);
      arrival.frame.set_capture_unix_ns(1'000'000'000 + static_cast<std::int64_t>(k) * 1'000'000);
      arrival.received_unix_ns = arrival.frame.capture_unix_ns() + 5'000'000;
      live_.feed(arrival);
    }
  }
  const std::string profile_ = test::sampleProfile("shoulder-adult");
  pb::SessionInfo info_ = test::lessonInfo(profile_);
  std::vector<GestureSample> samples_ = test::lessonSamples(profile_, {.depth_m = 0.02, .seconds = 1});
  LiveStation live_{"bench-1"};
};

TEST_F(LiveStationTest, whatCameBeforeTheDescriptionIsNotLost) {
  feed(0, 400);
  EXPECT_TRUE(live_.trace().empty());
  EXPECT_EQ(live_.sessionToRequest(10), info_.description().session_id());
  EXPECT_EQ(live_.sessionToRequest(10.1), "") << "it was asked for a moment ago";
  EXPECT_EQ(live_.sessionToRequest(13), info_.description().session_id()) << "no answer came";
  live_.setSession(info_);
  EXPECT_DOUBLE_EQ(live_.trace().firstTime_s(), 0);
  EXPECT_DOUBLE_EQ(live_.trace().lastTime_s(), 0.399);
  EXPECT_EQ(live_.sessionToRequest(20), "");
  feed(400, 1000);
  EXPECT_DOUBLE_EQ(live_.trace().lastTime_s(), 0.999);
  EXPECT_EQ(live_.stats().dropped(), 0u);
  EXPECT_EQ(live_.newestTick(), 999u);
  // same numbers as in the stored session
  const auto stored = gestureOf(info_, samples_);
  for (const auto channel :
       {TraceChannel::kForce, channelOf(Effect::kCutting), TraceChannel::kAlpha, TraceChannel::kDepth})
    EXPECT_EQ(live_.trace().value(channel, 0.9), stored->trace.value(channel, 0.9));
}

TEST_F(LiveStationTest, aPausedViewFreezesWhileTheStreamContinues) {
  live_.setSession(info_);
  feed(0, 600);
  live_.setSession(info_);
  live_.pause();
  const double stands_s = live_.viewEnd_s();
  feed(600, 1200);
  EXPECT_TRUE(live_.paused());
  EXPECT_EQ(live_.viewEnd_s(), stands_s);
  EXPECT_DOUBLE_EQ(live_.trace().lastTime_s(), 1.199) << "nothing of the stream was lost";
  live_.scrollTo(0.3);
  EXPECT_DOUBLE_EQ(live_.viewEnd_s(), 0.3);
  EXPECT_NEAR(live_.shown().time_s, 0.3, 0.011);
  live_.scrollTo(-50);
  EXPECT_EQ(live_.viewEnd_s(), 0);
  live_.resume();
  EXPECT_DOUBLE_EQ(live_.viewEnd_s(), 1.199);
  EXPECT_EQ(live_.shown().tick, 1199u);
}

TEST_F(LiveStationTest, gapsAreCountedAndFlagged) {
  live_.feed({});
  feed(0, 20);
  live_.setSession(info_);
  feed(20, 700);
  EXPECT_FALSE(live_.approximate());
  feed(800, 840);  // five frames were lost, in tissue
  EXPECT_EQ(live_.stats().dropped(), 5u);
  EXPECT_TRUE(live_.approximate());
  // only the force that was rendered is shown, until the view can follow again
  const auto shown = [&](TraceChannel channel) { return live_.trace().value(channel, 0.830); };
  EXPECT_NEAR(shown(TraceChannel::kForce).value_or(0), forceOf(momentOfSample(samples_[830], 1000)), 1e-6);
  EXPECT_GT(shown(TraceChannel::kForce).value_or(0), 0.1F);
  for (const EffectEntry* effect : effectsAsShown()) {
    if (effect->unit == "N") EXPECT_FALSE(shown(channelOf(effect->effect))) << effect->name;
    EXPECT_EQ(live_.shown().term(effect->effect), 0) << "no arrow of " << effect->name;
  }
  std::vector<std::string> gaps;
  for (const TraceEvent& event : live_.trace().events())
    if (event.kind == TraceEvent::Kind::kGap) gaps.push_back(wordsOf(event));
  EXPECT_EQ(gaps, std::vector<std::string>{"100 samples missing (100 ms)"});
  feed(840, samples_.size() / 20 * 20);  // out again
  EXPECT_FALSE(live_.approximate());
  EXPECT_TRUE(live_.trace().value(channelOf(Effect::kCutting), live_.trace().lastTime_s()));
}

TEST_F(LiveStationTest, whoComesLateKnowsTheOldCutsFromTheStationsMemory) {
  auto profile = parseProfile(profile_, "sample");
  ASSERT_TRUE(profile.ok());
  profile->add_effects(pb::Profile::CUT_MEMORY);
  profile->mutable_cut_memory()->set_cutting_share(0.3);
  profile->mutable_cut_memory()->set_radius_m(0.001);
  info_.mutable_description()->set_profile_json(profileJson(*profile));
  // in and out twice along one line
  samples_.resize(samples_.size() / 20 * 20);
  const std::size_t once = samples_.size();
  for (std::size_t k = 0; k < once; ++k) {
    GestureSample again = samples_[k];
    again.tick += once;
    again.time_ns += static_cast<std::int64_t>(once) * 1'000'000;
    samples_.push_back(again);
  }
  const auto model = compile(*sceneSpecOf(*profile), 1000);
  ASSERT_TRUE(model.ok());
  const auto state = std::make_unique<SimState>();
  StepReport report;
  std::vector<double> cutting_N;
  Bytes cuts;
  for (std::size_t k = 0; k < samples_.size(); ++k) {
    const TipSample tip = test::tipOf(samples_[k]);
    step(*model, tip, *state, report);
    samples_[k] = test::storedSample(k, tip, report);
    cutting_N.push_back(-report.cutting_N);
    if (k + 1 == once) cuts = encodeCuts({k, state->cuts, state->insertions});
  }
  const std::size_t deep = once + 900;
  for (const bool with_memory : {false, true})
    for (const bool described : {false, true}) {
      live_ = LiveStation("bench-1");
      LiveArrival first = test::lessonFrame(info_, samples_, once - 20);
      if (with_memory) first.frame.set_cut_memory(cuts.data(), cuts.size());
      live_.feed({});
      if (described) live_.feed(test::lessonFrame(info_, samples_, once - 40)), live_.setSession(info_);
      live_.feed(first);
      feed(once, deep);
      live_.setSession(info_);
      EXPECT_EQ(live_.approximate(), !with_memory);
      const double shown_N = live_.trace().last().term(Effect::kCutting);
      if (with_memory) {
        EXPECT_NEAR(-shown_N, cutting_N[deep - 1], 1e-9);
      }
    }
}

TEST_F(LiveStationTest, anotherSessionStartsFresh) {
  feed(0, 400);
  live_.setSession(info_);
  live_.pause();
  info_ = test::lessonInfo(profile_);
  feed(0, 20);
  EXPECT_FALSE(live_.paused());
  EXPECT_TRUE(live_.trace().empty());
  EXPECT_EQ(live_.sessionToRequest(0), info_.description().session_id());
  EXPECT_EQ(live_.stats().dropped(), 0u);
}

TEST_F(LiveStationTest, withoutAReadableProfileTheSamplesAreShownAsTheyAre) {
  feed(0, 700);
  info_.mutable_description()->set_profile_json("{}");
  live_.setSession(info_);
  EXPECT_FALSE(live_.scene().view);
  EXPECT_FALSE(live_.scene().why.empty());
  EXPECT_FALSE(live_.trace().empty());
  EXPECT_GT(live_.trace().peakForce_N(), 0);
}

TEST_F(LiveStationTest, bytesThatAreNoFrameAreCountedAndPassedOver) {
  LiveArrival arrival;
  arrival.frame.set_station("bench-1");
  arrival.frame.set_session_id(info_.description().session_id());
  arrival.frame.set_data("no chunk");
  live_.feed(arrival);
  arrival.frame.set_station("bench-2");
  live_.feed(arrival);
  EXPECT_EQ(live_.unreadable(), 1u);
}

TEST_F(LiveStationTest, aBoneContactIsMarkedOnTheTimeLine) {
  // the shoulder's bone is 35 mm deep below the target; the hand goes 40 mm deep from 10 mm above
  samples_ = test::lessonSamples(profile_, {.depth_m = 0.04, .seconds = 1});
  feed(0, 400);
  live_.setSession(info_);
  feed(400, samples_.size() / 20 * 20);
  const auto first =
      std::find_if(samples_.begin(), samples_.end(), [](const auto& s) { return s.p_WT_m[2] <= -0.035; });
  ASSERT_NE(first, samples_.end());
  std::vector<double> found_s;
  for (const TraceEvent& event : live_.trace().events())
    if (event.kind == TraceEvent::Kind::kBoneContact) found_s.push_back(event.time_s);
  ASSERT_EQ(found_s.size(), 1u);
  EXPECT_NEAR(found_s[0], 1e-3 * static_cast<double>(first->tick), 1.01e-3);
}

TEST_F(LiveStationTest, remarksStandOnTheTimeLine) {
  feed(0, 600);
  live_.setSession(info_);
  live_.addRemark(500, "slower");
  bool found = false;
  for (const TraceEvent& event : live_.trace().events())
    found =
        found || (event.kind == TraceEvent::Kind::kRemark && event.text == "slower" && event.time_s == 0.5);
  EXPECT_TRUE(found);
}

TEST_F(LiveStationTest, theSpanIsHeld) {
  live_.setSpan(0.001);
  EXPECT_EQ(live_.span_s(), 2);
  live_.setSpan(1e9);
  EXPECT_EQ(live_.span_s(), kLiveSpan_s);
}

pb::LiveFrame frame(std::uint64_t seq, std::int64_t capture_unix_ns = 0) {
  pb::LiveFrame f;
  f.set_frame_seq(seq);
  f.set_capture_unix_ns(capture_unix_ns);
  return f;
}

TEST(LiveStats, aGapInTheNumbersIsALoss) {
  LiveStats stats;
  for (const std::uint64_t seq : {10, 11, 14, 15, 20}) stats.add(frame(seq), 20, 0);
  EXPECT_EQ(stats.frames(), 5u);
  EXPECT_EQ(stats.samples(), 100u);
  EXPECT_EQ(stats.dropped(), 2u + 4u);
}

TEST(LiveStats, aStationThatStartsAgainIsNoLoss) {
  LiveStats stats;
  for (const std::uint64_t seq : {1000, 0, 1}) stats.add(frame(seq), 20, 0);
  stats.streamRestarts();
  stats.add(frame(500), 20, 0);
  EXPECT_EQ(stats.dropped(), 0u);
}

TEST(LiveStats, quantilesAreThoseOfTheLatencies) {
  LiveStats stats;
  EXPECT_EQ(stats.latencyMs(0.5), 0);
  // 1 … 1000 ms in a scrambled order (347 and 1000 have no common factor)
  for (std::uint64_t i = 0; i < 1000; ++i) {
    const auto ms = static_cast<std::int64_t>(i * 347 % 1000 + 1);
    stats.add(frame(i, 5'000'000'000), 20, 5'000'000'000 + ms * 1'000'000);
  }
  EXPECT_NEAR(stats.latencyMs(0.5), 500, 1e-3);
  EXPECT_NEAR(stats.latencyMs(0.99), 990, 1e-3);
  EXPECT_NEAR(stats.latencyMs(0), 1, 1e-3);
  EXPECT_NEAR(stats.latencyMs(1), 1000, 1e-3);
}

TEST(LatencyMeter, countsFromDueToPresented) {
  LatencyMeter meter;
  EXPECT_EQ(meter.quantile_ms(0.99), 0);
  meter.fed(1'000'000'000);
  meter.fed(1'020'000'000);
  meter.presented(1'050'000'000);
  EXPECT_EQ(meter.count(), 2u);
  EXPECT_NEAR(meter.last_ms(), 30, 1e-9);
  EXPECT_NEAR(meter.quantile_ms(1), 50, 1e-4);
  meter.presented(2'000'000'000);
  EXPECT_EQ(meter.count(), 2u) << "nothing new was shown";
}

TEST(LatencyMeter, quantilesAreByRank) {
  LatencyMeter meter;
  for (int i = 1; i <= 100; ++i) {
    meter.fed(1'000'000'000);
    meter.presented(1'000'000'000 + i * 1'000'000);
  }
  EXPECT_NEAR(meter.quantile_ms(0.5), 50, 1e-4);
  EXPECT_NEAR(meter.quantile_ms(0.99), 99, 1e-4);
}

TEST(LatencyMeter, theNewestAreKept) {
  LatencyMeter meter;
  for (std::size_t i = 0; i < LatencyMeter::kKept; ++i) {
    meter.fed(1);
    meter.presented(1'000'000'001);
  }
  for (std::size_t i = 0; i < LatencyMeter::kKept; ++i) {
    meter.fed(1);
    meter.presented(2'000'001);
  }
  EXPECT_NEAR(meter.quantile_ms(1), 2, 1e-4);
}

TEST(LatencyMeter, whatIsNotShownDoesNotCount) {
  LatencyMeter meter;
  meter.fed(0);  // a station without a clock
  meter.fed(5);
  meter.discard();
  meter.presented(1'000);
  EXPECT_EQ(meter.count(), 0u);
}

TEST_F(LiveStationTest, aLessonThatEndsWhileItIsWatchedStaysInView) {
  feed(0, 600);
  live_.setSession(info_);
  pb::StationStatus status;
  status.set_station("bench-1");
  status.set_online(true);
  live_.onStatus(status);  // the session has ended
  EXPECT_EQ(live_.sessionId(), info_.description().session_id());
  EXPECT_DOUBLE_EQ(live_.trace().lastTime_s(), 0.599);
  live_.scrollTo(0.2);
  EXPECT_NEAR(live_.shown().time_s, 0.2, 0.011);
  live_.resume();
  // samples still in transit belong to it
  feed(600, 620);
  EXPECT_DOUBLE_EQ(live_.trace().lastTime_s(), 0.619);
  live_.connectionLost();
  EXPECT_DOUBLE_EQ(live_.trace().lastTime_s(), 0.619);
  // another lesson's description does not rename this one
  pb::SessionInfo other = test::lessonInfo(profile_, "tom");
  live_.setSession(other);
  EXPECT_EQ(live_.info().description().trainee(), "tina");
}

}  // namespace
}  // namespace needlelab
