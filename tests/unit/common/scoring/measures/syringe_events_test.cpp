// Finds aspirations and injections in gestures made by formula.
#include "common/scoring/measures/syringe_events.h"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <random>

#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"
#include "tests/unit/common/scoring/gestures.h"

namespace needlelab {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using Kind = pb::SyringeEvent::Kind;

constexpr double kTime_s = 0.025;  // two bins plus the time for half a band at 0.1/s

/// A point of a piecewise linear plunger motion.
struct Knot {
  double t_s, plunger;
};
double along(const std::vector<Knot>& knots, double t_s) {
  if (t_s <= knots.front().t_s) return knots.front().plunger;
  for (std::size_t i = 1; i < knots.size(); ++i) {
    if (t_s > knots[i].t_s) continue;
    const double share = (t_s - knots[i - 1].t_s) / (knots[i].t_s - knots[i - 1].t_s);
    return knots[i - 1].plunger + share * (knots[i].plunger - knots[i - 1].plunger);
  }
  return knots.back().plunger;
}

/// A needle held 15 mm deep, with the plunger motion `knots`.
std::vector<GestureSample> held(const std::vector<Knot>& knots, double rate_hz = 1000,
                                double depth_m = 0.015) {
  return gesture(rate_hz, knots.back().t_s, [&](double t, GestureSample& sample) {
    setDepth(sample, depth_m);
    sample.plunger = along(knots, t);
  });
}

std::vector<pb::SyringeEvent> eventsOf(const std::vector<GestureSample>& samples, double rate_hz = 1000,
                                       const pb::Profile& profile = halfSpace()) {
  return syringeEvents(samples, rate_hz, profile, {});
}

std::vector<Kind> kindsOf(const std::vector<pb::SyringeEvent>& events) {
  std::vector<Kind> kinds;
  for (const auto& event : events) kinds.push_back(event.kind());
  return kinds;
}

const std::vector<Knot> kAspirateAndInject = {{0, 0.2},   {1, 0.2},   {1.5, 0.1},
                                              {2.5, 0.1}, {5.5, 0.9}, {7, 0.9}};

TEST(SyringeEvents, tellKindTimesAndStroke) {
  const auto events = eventsOf(held(kAspirateAndInject));
  ASSERT_THAT(kindsOf(events), ElementsAre(pb::SyringeEvent::ASPIRATION, pb::SyringeEvent::INJECTION));
  EXPECT_NEAR(events[0].begin_s(), 1.0, kTime_s);
  EXPECT_NEAR(events[0].end_s(), 1.5, kTime_s);
  EXPECT_NEAR(events[0].plunger_from(), 0.2, 1e-3);
  EXPECT_NEAR(events[0].plunger_to(), 0.1, 1e-3);
  EXPECT_NEAR(events[1].begin_s(), 2.5, kTime_s);
  EXPECT_NEAR(events[1].end_s(), 5.5, kTime_s);
  EXPECT_NEAR(events[1].plunger_to(), 0.9, 1e-3);
  // ticks and times are the same moments; the gesture's first tick is 1000
  EXPECT_NEAR(events[1].begin_s(), static_cast<double>(events[1].begin_tick() - 1000) / 1000, 1e-12);
  EXPECT_TRUE(events[0].begin().in_tissue());
  EXPECT_EQ(events[0].begin().layer(), 1);
  EXPECT_EQ(events[0].begin().tissue(), "MUSCLE");
  EXPECT_EQ(events[0].begin().layer_name(), "muscle");
  EXPECT_NEAR(events[0].begin().depth_m(), 0.015, 1e-12);
  EXPECT_NEAR(events[0].begin().insertion_m(), 0.015, 1e-12);
  EXPECT_NEAR(events[0].begin().z_m(), -0.015, 1e-12);
  EXPECT_EQ(events[0].in_tissue_share(), 1);
}

TEST(SyringeEvents, anInjectionBesideTheTissueIsNotInTheTarget) {
  // the shoulder: bursa from 25 to 27 mm, tendon under it; a ball of 3 mm about 26 mm
  const auto profile = loadProfile(NEEDLELAB_SAMPLES "/shoulder-adult.json");
  ASSERT_TRUE(profile.ok()) << profile.error().message;
  const double behind_m = openingBehindTip_m(needleOf(profile->needle()));
  ASSERT_GT(behind_m, 0.001);
  const auto injectedWithTheOpeningAt = [&](double depth_m) {
    const auto samples = held({{0, 0.2}, {1, 0.2}, {2, 0.8}, {3, 0.8}}, 1000, depth_m + behind_m);
    const auto events = eventsOf(samples, 1000, *profile);
    EXPECT_EQ(events.size(), 1u);
    return events.at(0);
  };
  EXPECT_EQ(injectedWithTheOpeningAt(0.026).in_target_share(), 1);
  EXPECT_EQ(injectedWithTheOpeningAt(0.026).begin().layer_name(), "bursa");
  const pb::SyringeEvent tendon = injectedWithTheOpeningAt(0.0278);
  EXPECT_EQ(tendon.in_target_share(), 0) << "within the ball's radius";
  EXPECT_EQ(tendon.begin().layer_name(), "tendon");
  EXPECT_NEAR(tendon.begin().target_distance_m(), 0.0008, 1e-12);
  EXPECT_EQ(injectedWithTheOpeningAt(0.0245).in_target_share(), 0) << "in muscle";
}

TEST(SyringeEvents, areTheSameAtEveryRate) {
  for (const double rate : {250.0, 500.0, 4000.0}) {
    SCOPED_TRACE(rate);
    const auto events = eventsOf(held(kAspirateAndInject, rate), rate);
    ASSERT_EQ(events.size(), 2u);
    EXPECT_NEAR(events[0].begin_s(), 1.0, kTime_s);
    EXPECT_NEAR(events[1].end_s(), 5.5, kTime_s);
    EXPECT_NEAR(events[1].plunger_to() - events[1].plunger_from(), 0.8, 2e-3);
  }
}

TEST(SyringeEvents, aRestingPlungerThatTremblesIsNoStroke) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> jitter(-0.004, 0.004);
  auto samples = held({{0, 0.3}, {20, 0.3}});
  for (auto& sample : samples) sample.plunger += jitter(random);
  EXPECT_THAT(eventsOf(samples), IsEmpty());
  // also with a slow tremor: 8 Hz, like a hand's
  samples = held({{0, 0.3}, {20, 0.3}});
  for (std::size_t i = 0; i < samples.size(); ++i)
    samples[i].plunger += 0.009 * std::sin(2 * 3.14159 * 8 * static_cast<double>(i) / 1000);
  EXPECT_THAT(eventsOf(samples), IsEmpty());
}

TEST(SyringeEvents, tremblingDoesNotCutAStrokeInTwo) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> jitter(-0.004, 0.004);
  auto samples = held(kAspirateAndInject);
  for (auto& sample : samples) sample.plunger += jitter(random);
  const auto events = eventsOf(samples);
  ASSERT_THAT(kindsOf(events), ElementsAre(pb::SyringeEvent::ASPIRATION, pb::SyringeEvent::INJECTION));
  EXPECT_NEAR(events[0].begin_s(), 1.0, 0.1);
  EXPECT_NEAR(events[0].plunger_from() - events[0].plunger_to(), 0.1, 0.008);
  EXPECT_NEAR(events[1].plunger_to() - events[1].plunger_from(), 0.8, 0.008);
  EXPECT_NEAR(events[1].end_s(), 5.5, 0.1);
}

TEST(SyringeEvents, theLeastStrokeDecides) {
  EXPECT_THAT(eventsOf(held({{0, 0.5}, {1, 0.5}, {1.2, 0.519}, {2, 0.519}})), IsEmpty());
  EXPECT_THAT(kindsOf(eventsOf(held({{0, 0.5}, {1, 0.5}, {1.2, 0.521}, {2, 0.521}}))),
              ElementsAre(pb::SyringeEvent::INJECTION));
  EXPECT_THAT(kindsOf(eventsOf(held({{0, 0.5}, {1, 0.5}, {1.2, 0.479}, {2, 0.479}}))),
              ElementsAre(pb::SyringeEvent::ASPIRATION));
}

TEST(SyringeEvents, aShortPauseJoinsAndALongOneParts) {
  for (const double speed_per_s : {0.05, 0.1, 0.33, 2.0}) {
    SCOPED_TRACE(speed_per_s);
    const double stroke_s = 0.3 / speed_per_s;
    const auto withPause = [&](double pause_s) {
      return eventsOf(held({{0, 0.1},
                            {1, 0.1},
                            {1 + stroke_s, 0.4},
                            {1 + stroke_s + pause_s, 0.4},
                            {1 + 2 * stroke_s + pause_s, 0.7},
                            {3 + 2 * stroke_s + pause_s, 0.7}}));
    };
    const auto joined = withPause(0.2);
    ASSERT_EQ(joined.size(), 1u);
    EXPECT_NEAR(joined[0].plunger_to() - joined[0].plunger_from(), 0.6, 2e-3);
    EXPECT_NEAR(joined[0].end_s() - joined[0].begin_s(), 2 * stroke_s + 0.2, 0.05);
    const auto parted = withPause(0.45);
    ASSERT_EQ(parted.size(), 2u);
    EXPECT_NEAR(parted[0].end_s(), 1 + stroke_s, 0.05);
    EXPECT_NEAR(parted[1].begin_s(), 1 + stroke_s + 0.45, 0.05);
  }
}

TEST(SyringeEvents, aVerySlowInjectionIsOne) {
  const auto events = eventsOf(held({{0, 0}, {1, 0}, {101, 1}, {103, 1}}, 250), 250);
  ASSERT_EQ(events.size(), 1u);
  EXPECT_NEAR(events[0].begin_s(), 1, 0.3);
  EXPECT_NEAR(events[0].end_s(), 101, 0.3);
}

TEST(SyringeEvents, aTurnWithoutARestPartsAtTheTurn) {
  const auto events = eventsOf(held({{0, 0.5}, {1, 0.5}, {1.5, 0.3}, {2.5, 0.8}, {4, 0.8}}));
  ASSERT_THAT(kindsOf(events), ElementsAre(pb::SyringeEvent::ASPIRATION, pb::SyringeEvent::INJECTION));
  EXPECT_NEAR(events[0].end_s(), 1.5, kTime_s);
  EXPECT_NEAR(events[1].begin_s(), 1.5, kTime_s);
  EXPECT_NEAR(events[1].plunger_from(), 0.3, 4e-3);  // the mean of 10 ms around the turn
}

TEST(SyringeEvents, aStrokeThatTheRecordingCutsOffEndsWithIt) {
  const auto events = eventsOf(held({{0, 0.2}, {1, 0.2}, {2, 0.6}}));
  ASSERT_EQ(events.size(), 1u);
  EXPECT_NEAR(events[0].end_s(), 2, kTime_s);
  EXPECT_NEAR(events[0].plunger_to(), 0.6, 5e-3);
  // An event that is in progress at the first sample begins there.
  const auto begun = eventsOf(held({{0, 0.2}, {1, 0.6}, {2, 0.6}}));
  ASSERT_EQ(begun.size(), 1u);
  EXPECT_NEAR(begun[0].begin_s(), 0, kTime_s);
}

TEST(SyringeEvents, missingTicksHideNothing) {
  auto samples = held(kAspirateAndInject);
  // all ticks except every 7th, and except those from 3 s to 5 s
  std::vector<GestureSample> kept;
  for (const auto& sample : samples) {
    const double t = static_cast<double>(sample.tick - 1000) / 1000;
    if (sample.tick % 7 == 0 && !(t > 3 && t < 5)) kept.push_back(sample);
  }
  const auto events = eventsOf(kept);
  ASSERT_THAT(kindsOf(events), ElementsAre(pb::SyringeEvent::ASPIRATION, pb::SyringeEvent::INJECTION));
  EXPECT_NEAR(events[1].begin_s(), 2.5, 0.03);
  EXPECT_NEAR(events[1].end_s(), 5.5, 0.03);
  EXPECT_NEAR(events[1].plunger_to() - events[1].plunger_from(), 0.8, 2e-3);
}

TEST(SyringeEvents, aStrokeInsideAGapSpansTheNeighbouringSamples) {
  auto samples = held({{0, 0.2}, {1, 0.2}, {1.5, 0.9}, {3, 0.9}});
  std::erase_if(samples, [](const GestureSample& s) { return s.tick > 1900 && s.tick < 2700; });
  const auto events = eventsOf(samples);
  ASSERT_EQ(events.size(), 1u);
  EXPECT_NEAR(events[0].begin_s(), 0.9, kTime_s);
  EXPECT_NEAR(events[0].end_s(), 1.7, kTime_s);
  EXPECT_NEAR(events[0].in_tissue_share(), 1, 1e-12);
}

TEST(SyringeEvents, aPlungerThatIsNoNumberIsPassedOver) {
  auto samples = held(kAspirateAndInject);
  for (std::size_t i = 0; i < samples.size(); i += 5) samples[i].plunger = std::nan("");
  EXPECT_EQ(eventsOf(samples).size(), 2u);
  for (auto& sample : samples) sample.plunger = std::nan("");
  EXPECT_THAT(eventsOf(samples), IsEmpty());
  EXPECT_THAT(eventsOf({}), IsEmpty());
  EXPECT_THAT(eventsOf(held({{0, 0.2}, {1e-9, 0.9}})), IsEmpty());
}

TEST(SyringeEvents, anInjectionDuringWithdrawalHasTwoPlacesAndShares) {
  // out from 25 mm at 10 mm/s while the plunger moves down evenly: 25 → 5 mm deep, from layer 2 to layer 0; a
  // target around 20 mm receives what is within 2 mm of it
  pb::Profile profile = halfSpace();
  addTarget(profile, {0, 0, -0.02}, 0.002);
  const auto samples = gesture(1000, 4, [](double t, GestureSample& sample) {
    setDepth(sample, 0.025 - 0.01 * std::clamp(t - 1, 0.0, 2.0));
    sample.plunger = 0.1 + 0.4 * std::clamp(t - 1, 0.0, 2.0);
  });
  const auto events = eventsOf(samples, 1000, profile);
  ASSERT_EQ(events.size(), 1u);
  const auto& event = events[0];
  EXPECT_EQ(event.begin().layer(), 2);
  EXPECT_EQ(event.begin().tissue(), "BONE");
  EXPECT_NEAR(event.begin().depth_m(), 0.025, 3e-4);
  EXPECT_EQ(event.end().layer(), 0);
  EXPECT_EQ(event.end().tissue(), "SKIN");
  EXPECT_NEAR(event.end().depth_m(), 0.005, 3e-4);
  EXPECT_NEAR(event.begin().target_distance_m(), 0.003, 3e-4);
  EXPECT_EQ(event.begin().target(), "target 1");
  // 4 of 20 mm
  EXPECT_NEAR(event.in_target_share(), 0.2, 0.005);
  EXPECT_NEAR(event.in_tissue_share(), 1, 1e-12);
  EXPECT_THAT(eventText(event), ::testing::HasSubstr("in bone"));
  EXPECT_THAT(eventText(event), ::testing::HasSubstr("; to "));
}

TEST(SyringeEvents, anEventOutsideTheTissueIsMarked) {
  const auto events = eventsOf(held({{0, 0.1}, {1, 0.1}, {2, 0.5}, {3, 0.5}}, 1000, -0.01));
  ASSERT_EQ(events.size(), 1u);
  EXPECT_FALSE(events[0].begin().in_tissue());
  EXPECT_EQ(events[0].begin().layer(), -1);
  EXPECT_EQ(events[0].begin().tissue(), "");
  EXPECT_EQ(events[0].begin().layer_name(), "");
  EXPECT_EQ(events[0].in_tissue_share(), 0);
  EXPECT_NEAR(events[0].begin().depth_m(), -0.01, 1e-12);
  EXPECT_EQ(eventText(events[0]), "injection of 40 % at 1.0 s for 1.0 s, outside the tissue");
}

TEST(SyringeEvents, thePlaceIsTheOpeningsNotTheTips) {
  pb::Profile profile = halfSpace();
  profile.mutable_needle()->set_length_m(0.06);
  profile.mutable_needle()->set_gauge(18);
  profile.mutable_needle()->set_tip(pb::Needle::HYPODERMIC);
  profile.mutable_needle()->set_bevel_angle_rad(0.2);
  const double behind = 0.0012 / (2 * std::tan(0.2));  // 2.96 mm
  addTarget(profile, {0, 0, -0.0105}, 0.001);
  // the tip is beyond the target, in the second layer; the opening is behind it, in the first
  const auto events = eventsOf(held({{0, 0.1}, {1, 0.1}, {2, 0.5}, {3, 0.5}}, 1000, 0.0115), 1000, profile);
  ASSERT_EQ(events.size(), 1u);
  const auto& place = events[0].begin();
  EXPECT_NEAR(place.depth_m(), 0.0115 - behind, 1e-9);
  EXPECT_NEAR(place.z_m(), -(0.0115 - behind), 1e-9);
  EXPECT_NEAR(place.insertion_m(), 0.0115 - behind, 1e-9);
  EXPECT_EQ(place.layer(), 0);
  EXPECT_NEAR(place.target_distance_m(), 0.0105 - (0.0115 - behind) - 0.001, 1e-9);
  EXPECT_EQ(events[0].in_target_share(), 0);
  // Only the tip is in: the opening is still outside.
  const auto shallow = eventsOf(held({{0, 0.1}, {1, 0.1}, {2, 0.5}, {3, 0.5}}, 1000, 0.002), 1000, profile);
  ASSERT_EQ(shallow.size(), 1u);
  EXPECT_FALSE(shallow[0].begin().in_tissue());
}

TEST(SyringeEvents, hazardsAreNamed) {
  pb::Profile profile = halfSpace();
  addBallHazard(profile, "nerve", {0, 0, -0.016}, 0.002);
  addBallHazard(profile, "far", {0.1, 0, -0.016}, 0.002);
  const auto events = eventsOf(held({{0, 0.1}, {1, 0.1}, {2, 0.5}, {3, 0.5}}), 1000, profile);
  ASSERT_EQ(events.size(), 1u);
  EXPECT_EQ(events[0].begin().hazard(), "nerve");
  EXPECT_THAT(std::vector<std::string>(events[0].hazards().begin(), events[0].hazards().end()),
              ElementsAre("nerve"));
  EXPECT_THAT(eventText(events[0]), ::testing::HasSubstr("into nerve"));
}

TEST(SyringeEvents, namesOfHazardsHaveABoundAndTheRestIsCounted) {
  constexpr std::size_t kHazards = 64, kNameBytes = 100, kKept = kMaxEventHazardBytes / kNameBytes;
  pb::Profile profile = halfSpace();
  std::vector<std::string> names;
  for (std::size_t i = 0; i < kHazards; ++i) {
    names.push_back(std::to_string(100 + i) + std::string(kNameBytes - 3, 'h'));
    addBallHazard(profile, names.back(), {0, 0, -0.015}, 0.005);
  }
  const auto events = eventsOf(held({{0, 0.1}, {1, 0.1}, {2, 0.5}, {3, 0.5}}), 1000, profile);
  ASSERT_EQ(events.size(), 1u);
  names.resize(kKept);
  names.push_back("and " + std::to_string(kHazards - kKept) + " more");
  EXPECT_THAT(std::vector<std::string>(events[0].hazards().begin(), events[0].hazards().end()),
              ::testing::ElementsAreArray(names));
}

TEST(SyringeEvents, aJumpingPlungerGivesABoundedNumberOfStrokes) {
  const auto jumps = [](std::size_t samples) {
    auto all = held({{0, 0}, {0.01 * static_cast<double>(samples), 0}}, 100);
    all.resize(samples);
    for (std::size_t i = 0; i < samples; ++i) all[i].plunger = static_cast<double>(i % 2);
    return all;
  };
  // a stroke between each two samples
  EXPECT_EQ(eventsOf(jumps(101), 100).size(), 100u);
  EXPECT_EQ(eventsOf(jumps(kMaxSyringeEvents), 100).size(), kMaxSyringeEvents - 1);
  const auto most = eventsOf(jumps(kMaxSyringeEvents + 1), 100);
  EXPECT_EQ(most.size(), kMaxSyringeEvents);
  const auto more = eventsOf(jumps(2 * kMaxSyringeEvents), 100);
  ASSERT_EQ(more.size(), kMaxSyringeEvents);
  EXPECT_EQ(more.back().end_tick(), most.back().end_tick()) << "the first ones";
}

TEST(SyringeEvents, aPlacedLimbMovesTheSurroundings) {
  pb::Profile profile = halfSpace();
  addTarget(profile, {0, 0, -0.015}, 0.001);
  const Pose X_WL{{0.3, -0.2, 0.1}, {0, 0, 0, 1}};
  auto samples = held({{0, 0.1}, {1, 0.1}, {2, 0.5}, {3, 0.5}});
  for (auto& sample : samples) {
    sample.p_WT_m[0] += 0.3;
    sample.p_WT_m[1] -= 0.2;
    sample.p_WT_m[2] += 0.1;
  }
  const auto events = syringeEvents(samples, 1000, profile, X_WL);
  ASSERT_EQ(events.size(), 1u);
  EXPECT_NEAR(events[0].begin().target_distance_m(), -0.001, 1e-9);
  EXPECT_NEAR(events[0].begin().x_m(), 0.3, 1e-12);
  EXPECT_EQ(events[0].in_target_share(), 1);
}

TEST(SyringeEvents, theProfileNamesTheLayersOfStoredEvents) {
  pb::Profile profile = halfSpace();
  profile.mutable_layers(1)->set_name("dura");
  auto events = eventsOf(held(kAspirateAndInject), 1000, profile);
  ASSERT_EQ(events.size(), 2u);
  EXPECT_THAT(eventText(events[1]), ::testing::HasSubstr("15 mm deep in dura"));
  EXPECT_EQ(events[1].end().tissue(), "MUSCLE") << "for computers it stays";
  // as read from a database
  for (auto& event : events)
    event.mutable_begin()->clear_layer_name(), event.mutable_end()->clear_layer_name();
  EXPECT_THAT(eventText(events[1]), ::testing::HasSubstr("15 mm deep in MUSCLE"));
  nameLayers(profile, events);
  EXPECT_EQ(events[0].begin().layer_name(), "dura");
  EXPECT_EQ(events[0].end().layer_name(), "dura");
  // a layer that this profile does not have, and a place outside
  events[0].mutable_begin()->set_layer(3);
  events[0].mutable_begin()->clear_layer_name();
  auto outside = eventsOf(held({{0, 0.1}, {1, 0.1}, {2, 0.5}, {3, 0.5}}, 1000, -0.01), 1000, profile);
  nameLayers(profile, events);
  nameLayers(profile, outside);
  EXPECT_EQ(events[0].begin().layer_name(), "");
  EXPECT_EQ(outside[0].begin().layer_name(), "");
}

TEST(SyringeEvents, asJsonSayEverything) {
  pb::Profile profile = halfSpace();
  addTarget(profile, {0, 0, -0.015}, 0.001);
  const auto rows = nlohmann::json::parse(eventsJson(eventsOf(held(kAspirateAndInject), 1000, profile)));
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_EQ(rows[0].at("event"), "ASPIRATION");
  EXPECT_EQ(rows[1].at("event"), "INJECTION");
  EXPECT_EQ(rows[1].at("begin").at("tissue"), "MUSCLE");
  EXPECT_EQ(rows[1].at("begin").at("layer_name"), "muscle");
  EXPECT_TRUE(rows[1].at("begin").at("hazard").is_null());
  EXPECT_NEAR(rows[1].at("end").at("target_distance_m").get<double>(), -0.001, 1e-9);
  EXPECT_EQ(rows[1].at("words"),
            "injection of 80 % at 2.5 s for 3.0 s, 15 mm deep in muscle, 1 mm inside target 1");
}

TEST(SyringeMeasures, sumUpTheStrokes) {
  pb::Profile profile = halfSpace();
  addTarget(profile, {0, 0, -0.015}, 0.001);
  const auto measures = scoreGesture(held(kAspirateAndInject), 1000, profile, {});
  EXPECT_EQ(valueOf(measures, "aspirations"), 1);
  EXPECT_EQ(valueOf(measures, "injections"), 1);
  EXPECT_NEAR(valueOf(measures, "injected_share"), 0.8, 2e-3);
  EXPECT_NEAR(valueOf(measures, "injected_in_target_share"), 1, 1e-9);
  EXPECT_EQ(valueOf(measures, "aspirated_before_injection"), 1);
}

TEST(SyringeMeasures, anAspirationAfterwardsOrOutsideDoesNotCount) {
  pb::Profile profile = halfSpace();
  const auto after =
      scoreGesture(held({{0, 0.1}, {1, 0.1}, {2, 0.6}, {3, 0.6}, {3.5, 0.5}, {5, 0.5}}), 1000, profile, {});
  EXPECT_EQ(valueOf(after, "aspirated_before_injection"), 0);
  EXPECT_EQ(find(after, "injected_in_target_share"), nullptr) << "there is no target";
  // aspirated in the air, then in, then injected
  const auto outside = gesture(1000, 6, [](double t, GestureSample& sample) {
    setDepth(sample, t < 2.5 ? -0.01 : 0.015);
    sample.plunger = along({{0, 0.2}, {1, 0.2}, {1.5, 0.1}, {4, 0.1}, {5, 0.6}, {6, 0.6}}, t);
  });
  EXPECT_EQ(valueOf(scoreGesture(outside, 1000, profile, {}), "aspirated_before_injection"), 0);
}

TEST(SyringeMeasures, anExerciseMayAskForThem) {
  pb::Profile profile = halfSpace();
  addTarget(profile, {0, 0, -0.02}, 0.001);
  pb::Exercise exercise;
  for (const char* name : {"injected_in_target_share", "aspirated_before_injection", "injections"}) {
    auto& requirement = *exercise.add_requirements();
    requirement.set_measure(name);
    requirement.set_min(name == std::string("injections") ? 1 : 0.8);
  }
  ASSERT_TRUE(checkRequirements(exercise).ok());
  const auto words = [&](const std::vector<GestureSample>& samples, const std::string& name) {
    for (const Measure& measure : scoreGesture(samples, 1000, profile, {}, &exercise))
      if (measure.name == name) return (*measure.passed ? "pass: " : "FAIL: ") + measure.words;
    return std::string();
  };
  const auto beside = held(kAspirateAndInject);
  EXPECT_EQ(words(beside, "injected_in_target_share"),
            "FAIL: Share of the injection in the target 0 %: below the 80 % asked for");
  EXPECT_EQ(words(beside, "aspirated_before_injection"), "pass: Aspirated before the injection");
  const auto within = held(kAspirateAndInject, 1000, 0.02);
  EXPECT_EQ(words(within, "injected_in_target_share"),
            "pass: Share of the injection in the target 100 %: at least the 80 % asked for");
  const auto without = held({{0, 0.2}, {3, 0.2}});
  EXPECT_EQ(words(without, "injections"), "FAIL: Injections 0: below the 1 asked for");
  EXPECT_EQ(words(without, "injected_in_target_share"), "FAIL: You did not inject.");
  const auto never = held({{0, 0.2}, {1, 0.2}, {2, 0.7}, {3, 0.7}});
  EXPECT_EQ(words(never, "aspirated_before_injection"),
            "FAIL: Not aspirated before the injection: it had to be");
}

}  // namespace
}  // namespace needlelab
