#include "client/view/model/gesture_trace.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <utility>
#include <vector>

#include "tests/support/random.h"
#include "tests/support/view_lesson/sample_lesson.h"

namespace needlelab {
namespace {

Moment momentAt(double time_s, double force_N, int layer = -1) {
  Moment moment;
  moment.tick = static_cast<std::uint64_t>(std::llround(time_s * 1000));
  moment.time_s = time_s;
  moment.force_W_N = {0, 0, force_N};
  moment.layer = layer;
  return moment;
}

TEST(GestureTrace, columnsAreThoseOfAllPointsOneByOne) {
  test::Random draw(11);
  GestureTrace trace(1000);
  std::vector<double> x, y;
  double time_s = 0;
  for (int i = 0; i < 5000; ++i) {
    time_s += draw.chance(0.02) ? 0.2 : 0.001;
    const double force_N = draw.in(0, 5);
    trace.push(momentAt(time_s, force_N));
    x.push_back(time_s);
    y.push_back(force_N);
  }
  for (int round = 0; round < 60; ++round) {
    const double from = draw.in(-1, time_s), to = from + draw.in(0.001, time_s);
    std::vector<PixelColumn> quick(1 + draw.below(700)), slow(quick.size());
    trace.columns(TraceChannel::kForce, from, to, quick);
    fillColumns(x, y, from, to, slow);
    for (std::size_t i = 0; i < quick.size(); ++i) {
      ASSERT_EQ(quick[i].empty(), slow[i].empty()) << round << ", " << i;
      if (quick[i].empty()) continue;
      ASSERT_FLOAT_EQ(quick[i].min, slow[i].min) << round << ", " << i;
      ASSERT_FLOAT_EQ(quick[i].max, slow[i].max) << round << ", " << i;
      ASSERT_FLOAT_EQ(quick[i].last, slow[i].last) << round << ", " << i;
    }
  }
}

TEST(GestureTrace, forgetsSamplesOlderThanItsSpan) {
  GestureTrace trace(2);
  for (int i = 0; i < 10000; ++i) trace.push(momentAt(i * 0.001, 1, i % 5000 < 2500 ? -1 : 0));
  EXPECT_GT(trace.firstTime_s(), 5.9);
  EXPECT_LE(trace.firstTime_s(), 8.0);
  EXPECT_DOUBLE_EQ(trace.lastTime_s(), 9.999);
  for (const TraceEvent& event : trace.events()) EXPECT_GE(event.time_s, 7.99);
  EXPECT_GE(trace.at(0).time_s, 7.9);
}

TEST(GestureTrace, theValueAtATimeIsThatOfTheTickBefore) {
  GestureTrace trace;
  for (int i = 0; i < 3000; ++i) trace.push(momentAt(i * 0.001, i));
  EXPECT_FALSE(trace.value(TraceChannel::kForce, -0.1));
  EXPECT_FLOAT_EQ(trace.value(TraceChannel::kForce, 0.0104).value(), 10);
  EXPECT_FLOAT_EQ(trace.value(TraceChannel::kForce, 1.5005).value(), 1500);
  EXPECT_FLOAT_EQ(trace.value(TraceChannel::kForce, 99).value(), 2999);
  EXPECT_FALSE(trace.value(TraceChannel::kTilt, 1));  // undefined outside
  EXPECT_DOUBLE_EQ(trace.peakForce_N(), 2999);
}

TEST(GestureTrace, wholeMomentsComeEachHundredthOfASecond) {
  GestureTrace trace;
  for (int i = 0; i < 2000; ++i) trace.push(momentAt(i * 0.001, i));
  EXPECT_DOUBLE_EQ(trace.at(1.2345).time_s, 1.23);
  EXPECT_DOUBLE_EQ(trace.at(50).time_s, 1.999);
  const auto some = trace.between(0.5, 0.6);
  ASSERT_EQ(some.size(), 11u);
  EXPECT_DOUBLE_EQ(some.front().time_s, 0.5);
}

TEST(GestureTrace, findsEntryLayersRuptureStopFaultAndExit) {
  const test::SampleLesson lesson = test::sampleLesson("shoulder-adult");
  GestureReplica replica(lesson.model);
  GestureTrace trace;
  std::map<TraceEvent::Kind, int> expected, found;
  int layer = -1;
  for (const GestureSample& sample : lesson.samples) {
    if (sample.layer >= 0 && layer < 0) ++expected[TraceEvent::Kind::kEntry];
    if (sample.layer < 0 && layer >= 0) ++expected[TraceEvent::Kind::kExit];
    if (sample.layer >= 0 && layer >= 0 && layer != sample.layer) ++expected[TraceEvent::Kind::kLayerChange];
    if ((sample.flags & kFlagRupture) != 0) ++expected[TraceEvent::Kind::kRupture];
    layer = sample.layer;
    trace.push(replica.feed(sample));
  }
  for (const TraceEvent& event : trace.events()) {
    if (expected.contains(event.kind)) ++found[event.kind];
    EXPECT_FALSE(nameOf(event.kind).empty());
    EXPECT_FALSE(signOf(event.kind).empty());
  }
  EXPECT_EQ(found, expected);
  EXPECT_EQ(expected[TraceEvent::Kind::kEntry], 1);
  EXPECT_EQ(expected[TraceEvent::Kind::kRupture], 1);
}

std::vector<TraceEvent> gapsOf(const GestureTrace& trace) {
  std::vector<TraceEvent> found;
  for (const TraceEvent& event : trace.events())
    if (event.kind == TraceEvent::Kind::kGap) found.push_back(event);
  return found;
}

TEST(GestureTrace, missingTicksAreAnEventWithTheirNumber) {
  GestureTrace trace;
  for (int i = 0; i < 4000; ++i) {
    const bool lost = (i >= 100 && i < 120) || i == 500 || (i >= 1000 && i < 2234);
    if (!lost) trace.push(momentAt(i * 0.001, 1));
  }
  const auto events = gapsOf(trace);
  ASSERT_EQ(events.size(), 3u);
  const char* const words[] = {"20 samples missing (20 ms)", "1 sample missing (1 ms)",
                               "1234 samples missing (1.2 s)"};
  const double last_before_s[] = {0.099, 0.499, 0.999}, first_behind_s[] = {0.120, 0.501, 2.234};
  ASSERT_EQ(trace.gaps().size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(wordsOf(events[i]), words[i]);
    EXPECT_DOUBLE_EQ(events[i].time_s, last_before_s[i]);
    EXPECT_DOUBLE_EQ(trace.gaps()[i].from, last_before_s[i]);
    EXPECT_DOUBLE_EQ(trace.gaps()[i].to, first_behind_s[i]);
  }
  trace.clear();
  EXPECT_TRUE(trace.gaps().empty());
}

TEST(GestureTrace, nearbyGapsMergeIntoOneEvent) {
  GestureTrace trace;
  // every 20th tick of half a second is missing: 25 of them
  for (int i = 0; i < 2000; ++i)
    if (i < 500 || i >= 1000 || i % 20 != 10) trace.push(momentAt(i * 0.001, 1));
  ASSERT_EQ(gapsOf(trace).size(), 1u);
  EXPECT_EQ(gapsOf(trace)[0].missing, 25u);
  EXPECT_NEAR(gapsOf(trace)[0].missing_s, 0.025, 1e-9);
  EXPECT_DOUBLE_EQ(gapsOf(trace)[0].time_s, 0.509);
  EXPECT_EQ(trace.gaps().size(), 25u) << "each one breaks the curve";
}

TEST(GestureTrace, aThinnedRecordingHasGapsOnlyWhereItsSamplesAreMissing) {
  // out of 1000 per second: 300 in steps of 3 and 4 ticks, 800 and 999 in steps of 1 and 2
  for (const double rate_hz : {300.0, 333.333333333, 800.0, 999.0}) {
    const double step_ticks = 1000 / rate_hz;
    const auto gapsAt = [&](const std::vector<int>& lost) {
      GestureTrace trace(300, {}, step_ticks);
      for (int i = 0; i < 1600; ++i)
        if (std::find(lost.begin(), lost.end(), i) == lost.end())
          trace.push(momentAt(std::ceil(i * step_ticks) * 0.001, 1));
      return gapsOf(trace);
    };
    EXPECT_TRUE(gapsAt({}).empty()) << rate_hz;
    if (rate_hz > 900) continue;  // a step of two ticks is normal there: it does not indicate a loss
    const auto one = gapsAt({200}), three = gapsAt({200, 201, 202});
    ASSERT_EQ(one.size(), 1u) << rate_hz;
    EXPECT_EQ(one[0].missing, 1u) << rate_hz;
    ASSERT_EQ(three.size(), 1u) << rate_hz;
    EXPECT_EQ(three[0].missing, 3u) << rate_hz;
    EXPECT_NEAR(three[0].missing_s, 3 * 0.001 * step_ticks, 1e-3) << rate_hz;
  }
}

TEST(GestureTrace, findsContactsWithBone) {
  const test::SampleLesson lesson = test::sampleLesson("shoulder-adult");
  const BoneContacts bones(lesson.profile, anatomyOf(lesson.profile, {}));
  // skin, then the last layer, which is bone: tremor, a withdrawal, and bone again
  const int bone = lesson.profile.layers_size() - 1;
  ASSERT_EQ(lesson.profile.layers(bone).tissue(), pb::Layer::BONE);
  const auto contactsOf = [&](GestureTrace trace) {
    for (int i = 0; i < 2000; ++i) {
      const bool in_bone = (i >= 500 && i < 1000 && i % 100 < 70) || i >= 1500;
      trace.push(momentAt(0.001 * i, 0, in_bone ? bone : 0));
    }
    std::vector<double> found_s;
    for (const TraceEvent& event : trace.events()) {
      if (event.kind == TraceEvent::Kind::kBoneContact) found_s.push_back(event.time_s);
    }
    return found_s;
  };
  EXPECT_EQ(contactsOf(GestureTrace(300, bones)), (std::vector<double>{0.5, 1.5}));
  EXPECT_TRUE(contactsOf(GestureTrace()).empty()) << "of a scene that is not known";
  EXPECT_EQ(nameOf(TraceEvent::Kind::kBoneContact), "bone contact");
  // another session in the same scene starts over, with the same bones
  GestureTrace trace(300, bones);
  trace.push(momentAt(7, 0, bone));
  EXPECT_EQ(contactsOf(std::move(trace)), (std::vector<double>{0.5, 1.5}));
}

TEST(GestureTrace, findsContactsOfTheHubWithTheSkin) {
  // in to the hub with tremor, drawn back, and in to the hub again
  GestureTrace trace;
  for (int i = 0; i < 2000; ++i) {
    Moment moment = momentAt(0.001 * i, 0, 0);
    if ((i >= 500 && i < 1000 && i % 100 < 70) || i >= 1500) moment.flags = kFlagBeyondNeedle;
    trace.push(moment);
  }
  std::vector<double> found_s;
  for (const TraceEvent& event : trace.events()) {
    if (event.kind == TraceEvent::Kind::kHubContact) found_s.push_back(event.time_s);
  }
  EXPECT_EQ(found_s, (std::vector<double>{0.5, 1.5}));
}

TEST(GestureTrace, aRemarkIsSortedByTimeAndAnEarlierTimeRestarts) {
  GestureTrace trace;
  trace.push(momentAt(1.999, 0));
  trace.push(momentAt(2, 0, 1));
  TraceEvent remark;
  remark.kind = TraceEvent::Kind::kRemark;
  remark.time_s = 1.5;
  remark.text = "good angle";
  trace.add(remark);
  ASSERT_EQ(trace.events().size(), 2u);
  EXPECT_EQ(trace.events().front().text, "good angle");
  trace.push(momentAt(0.5, 0));
  EXPECT_TRUE(trace.events().empty());
  EXPECT_DOUBLE_EQ(trace.firstTime_s(), 0.5);
}

TEST(GestureTrace, aSourceOutlivesAMoveOfItsTraceAndGivesShownUnits) {
  GestureTrace trace;
  Moment moment = momentAt(1, 0);
  moment.depth_m = 0.0125;
  trace.push(moment);
  const ColumnSource source = trace.source(TraceChannel::kDepth);
  const GestureTrace moved = std::move(trace);
  std::vector<PixelColumn> columns(1);
  source(0, 2, columns);
  EXPECT_FLOAT_EQ(columns[0].last, 12.5F);
}

TEST(TraceChannels, whatTheCapPressesInIsNoDepth) {
  Moment moment;
  moment.depth_m = 0.002;
  EXPECT_DOUBLE_EQ(valueOf(TraceChannel::kDepth, moment), 0.002);
  moment.flags |= kFlagCapped;
  EXPECT_TRUE(std::isnan(valueOf(TraceChannel::kDepth, moment)));
}

TEST(TraceChannels, areNamedAndPointTheSameWayForEveryEffect) {
  for (std::size_t i = 0; i < kChannelCount; ++i)
    EXPECT_FALSE(infoOf(static_cast<TraceChannel>(i)).name.empty()) << i;
  Moment moment;
  moment.term(Effect::kCutting) = -2;  // pushes the hand out
  moment.term(Effect::kAttracted) = 0.4;
  EXPECT_DOUBLE_EQ(valueOf(channelOf(Effect::kCutting), moment), 2);
  EXPECT_DOUBLE_EQ(valueOf(channelOf(Effect::kAttracted), moment), -0.4);
}

TEST(GestureTrace, valuesThatAreNoNumbersAreNeitherDrawnNorRead) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN(),
                   kInfinity = std::numeric_limits<double>::infinity();
  GestureTrace trace;
  const std::vector<double> forces_N = {1, kNan, 3, kInfinity, 2, 1e300};
  for (std::size_t i = 0; i < forces_N.size(); ++i)
    trace.push(momentAt(0.5 + static_cast<double>(i), forces_N[i]));
  std::vector<PixelColumn> columns(forces_N.size());
  trace.columns(TraceChannel::kForce, 0, static_cast<double>(forces_N.size()), columns);
  for (std::size_t i = 0; i < forces_N.size(); ++i) {
    const bool usable = i % 2 == 0;
    EXPECT_EQ(columns[i].empty(), !usable) << i;
    const auto value = trace.value(TraceChannel::kForce, 0.6 + static_cast<double>(i));
    EXPECT_EQ(value.has_value(), usable) << i;
    if (usable) {
      EXPECT_FLOAT_EQ(columns[i].last, static_cast<float>(forces_N[i]));
      EXPECT_FLOAT_EQ(value.value_or(-1), static_cast<float>(forces_N[i]));
    }
  }
  EXPECT_DOUBLE_EQ(trace.peakForce_N(), 3);
}

TEST(GestureTrace, anEmptyOneAnswersWithoutInventingAnything) {
  const GestureTrace trace;
  EXPECT_TRUE(trace.empty());
  EXPECT_EQ(trace.peakForce_N(), 0);
  EXPECT_FALSE(trace.value(TraceChannel::kForce, 0));
  EXPECT_TRUE(trace.between(-1e9, 1e9).empty());
  std::vector<PixelColumn> columns(3);
  columns[1].take(5);
  trace.columns(TraceChannel::kDepth, 0, 1, columns);
  for (const PixelColumn& column : columns) EXPECT_TRUE(column.empty());
}

TEST(GestureTrace, whatGoesOnIsOneEventAndWhatComesAgainIsAnother) {
  using Kind = TraceEvent::Kind;
  const auto timesOf = [](Kind kind, const std::function<void(int, Moment&)>& change) {
    GestureTrace trace;
    for (int i = 1; i <= 20; ++i) {
      Moment moment = momentAt(0.1 * i, 0, 0);
      change(i, moment);
      trace.push(moment);
    }
    std::vector<int> found;
    for (const TraceEvent& event : trace.events())
      if (event.kind == kind) found.push_back(static_cast<int>(std::lround(10 * event.time_s)));
    return found;
  };
  // a turn from 0.3 to 0.8 s, and one 0.5 s later
  EXPECT_EQ(timesOf(Kind::kTurn,
                    [](int i, Moment& m) {
                      if ((i >= 3 && i <= 8) || i == 13) m.flags |= kFlagTurn;
                    }),
            (std::vector<int>{3, 13}));
  // a fault that stays, changes to another one, ends and returns
  EXPECT_EQ(timesOf(Kind::kFault,
                    [](int i, Moment& m) {
                      m.fault = i < 4 ? 0 : i < 8 ? 2 : i < 10 ? 4 : i < 15 ? 0 : 4;
                    }),
            (std::vector<int>{4, 8, 15}));
  EXPECT_EQ(timesOf(Kind::kStop,
                    [](int i, Moment& m) {
                      m.phase = (i >= 5 && i < 9) || i >= 12 ? Phase::kStopped : Phase::kInserting;
                    }),
            (std::vector<int>{5, 12}));
  EXPECT_EQ(timesOf(Kind::kEntry, [](int i, Moment& m) { m.layer = i >= 6 && i != 10 ? 1 : -1; }),
            (std::vector<int>{6, 11}));
}

}  // namespace
}  // namespace needlelab
