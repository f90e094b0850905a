#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <numbers>
#include <random>

#include "common/scoring/measures/measure_table.h"
#include "common/scoring/measures/measures.h"
#include "tests/support/anatomy/ball_profiles.h"
#include "tests/unit/common/scoring/gestures.h"

namespace needlelab {
namespace {

TEST(Motion, aStraightLineAtConstantSpeed) {
  const auto samples = gesture(1000, 2, [](double t, GestureSample& s) {
    setTip(s, {0.03 * t, 0.04 * t, 0.1});
  });
  const auto score = scoreGesture(samples, 1000, halfSpace(), {});
  EXPECT_NEAR(valueOf(score, "elapsed_s"), 2, 1e-12);
  EXPECT_NEAR(valueOf(score, "path_length_m"), 0.1, 1e-12);
  EXPECT_NEAR(valueOf(score, "mean_speed_m_s"), 0.05, 1e-12);
  EXPECT_NEAR(valueOf(score, "peak_speed_m_s"), 0.05, 1e-10);
  EXPECT_EQ(valueOf(score, "time_in_tissue_s"), 0);
  EXPECT_EQ(valueOf(score, "entries"), 0);
  EXPECT_EQ(valueOf(score, "hazards_touched"), 0);
  EXPECT_EQ(find(score, "target_reached"), nullptr) << "the profile has no target";
}

TEST(Motion, aCirclesLengthIsItsCircumference) {
  // 4 rounds of 50 mm radius, 2 s each: the filter removes 2^(−(0.5/6)²/2) = 0.24 %
  const auto samples = gesture(1000, 8, [](double t, GestureSample& s) {
    setTip(s, {0.05 * std::cos(std::numbers::pi * t), 0.05 * std::sin(std::numbers::pi * t), 0.1});
  });
  const auto score = scoreGesture(samples, 1000, halfSpace(), {});
  const double circle = 4 * 2 * std::numbers::pi * 0.05;
  EXPECT_NEAR(valueOf(score, "path_length_m"), circle, 0.003 * circle);
  EXPECT_NEAR(valueOf(score, "peak_speed_m_s"), 0.05 * std::numbers::pi, 0.005);
}

TEST(Motion, tremorHardlyLengthensThePath) {
  const auto path = [](double amplitude_m) {
    const auto samples = gesture(1000, 5, [&](double t, GestureSample& s) {
      setTip(s, {0.02 * t, amplitude_m * std::sin(2 * std::numbers::pi * 10 * t), 0.1});
    });
    return valueOf(scoreGesture(samples, 1000, halfSpace(), {}), "path_length_m");
  };
  // 100 µm at 10 Hz: unfiltered, the path would be at least 0.102 m; at 20 mm/s it is 0.1 m
  EXPECT_NEAR(path(1e-4), path(0), 1e-3);
}

TEST(Motion, timeAndPathInTissue) {
  const auto score = scoreGesture(inAndOut(1000), 1000, halfSpace(), {});
  // 20 of 45 mm are above the skin: the ease passes the share 4/9 at s ≈ 0.4703, found here by bisection
  double low = 0, high = 1;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (ease(middle, 1) < 4.0 / 9 ? low : high) = middle;
  }
  EXPECT_NEAR(valueOf(score, "time_in_tissue_s"), 2 * (2 - 2 * low) + 1, 2e-3);
  EXPECT_NEAR(valueOf(score, "path_in_tissue_m"), 0.05, 2e-4);
  EXPECT_NEAR(valueOf(score, "path_length_m"), 0.09, 2e-4);
  // the peak speed of a minimum-jerk movement is 15/8 of its mean
  EXPECT_NEAR(valueOf(score, "peak_speed_m_s"), 1.875 * 0.0225, 2e-4);
  EXPECT_NEAR(valueOf(score, "path_inefficiency"), 1, 5e-3);
  EXPECT_TRUE(find(score, "sparc") != nullptr && find(score, "ldlj") != nullptr);
}

// The share of a step in tissue rises from the tick before the first one in tissue, and falls to the tick
// after the last one. Where that tick ends a step, the next step outside does not count, as a tick further
// in.
TEST(Motion, anEntryOrExitOnTheEndOfAStepLeavesTheStepBesideItOutside) {
  for (int steps = 100; steps < 400; steps += 7) {
    const double end_s = 0.01 * steps;
    const auto smoothness = [&](double entry_s, double exit_s) {
      const auto samples = gesture(1000, end_s, [&](double t, GestureSample& s) {
        setDepth(s, t > entry_s && t < exit_s ? 0.005 : -0.005);
        setTip(s, {0.05 * ease(t, end_s), 0, -0.005});
      });
      return valueOf(scoreGesture(samples, 1000, halfSpace(), {}), "ldlj");
    };
    for (int step = 5; step < steps / 2; step += 9) {
      const double entry_s = 0.01 * step + 0.0002, exit_s = end_s - 0.01 * step - 0.0002;
      const double expected = smoothness(entry_s + 0.001, exit_s - 0.001);
      ASSERT_EQ(smoothness(entry_s, exit_s - 0.001), expected) << step << " of " << steps;
      ASSERT_EQ(smoothness(entry_s + 0.001, exit_s), expected) << step << " of " << steps;
    }
  }
}

TEST(Motion, aShaftMovedAsideSweepsLengthTimesWay) {
  // 20 mm in tissue, moved 8 mm aside along y
  const auto samples = gesture(1000, 2, [](double t, GestureSample& s) {
    setDepth(s, 0.02);
    setTip(s, {0, 0.008 * ease(t, 2), -0.02});
  });
  EXPECT_NEAR(valueOf(scoreGesture(samples, 1000, halfSpace(), {}), "tissue_damage_m2"), 0.02 * 0.008, 1e-8);
}

TEST(Motion, aShaftTurnedAboutTheSkinSweepsASector) {
  // about x through the entry, 0.4 rad, 30 mm deep: r²φ/2
  const auto samples = gesture(1000, 2, [](double t, GestureSample& s) {
    const double angle = 0.4 * ease(t, 2);
    setDepth(s, 0.03);
    setDown(s, angle);
    const Vec3 axis = zAxis({s.q_WT[0], s.q_WT[1], s.q_WT[2], s.q_WT[3]});
    setTip(s, 0.03 * axis);
  });
  EXPECT_NEAR(valueOf(scoreGesture(samples, 1000, halfSpace(), {}), "tissue_damage_m2"),
              0.5 * 0.03 * 0.03 * 0.4, 5e-7);
}

TEST(Motion, straightInAndOutSweepsNothing) {
  EXPECT_NEAR(valueOf(scoreGesture(inAndOut(1000), 1000, halfSpace(), {}), "tissue_damage_m2"), 0, 1e-12);
}

TEST(Tissue, depthsForcesAndLayers) {
  const auto score = scoreGesture(inAndOut(1000), 1000, halfSpace(), {});
  EXPECT_NEAR(valueOf(score, "greatest_depth_m"), 0.025, 1e-12);
  EXPECT_NEAR(valueOf(score, "greatest_insertion_m"), 0.025, 1e-12);
  EXPECT_EQ(valueOf(score, "peak_force_n"), 3);
  EXPECT_EQ(valueOf(score, "peak_force_layer_1_n"), 1);
  EXPECT_EQ(valueOf(score, "peak_force_layer_2_n"), 2);
  EXPECT_EQ(valueOf(score, "peak_force_layer_3_n"), 3);
  EXPECT_EQ(find(score, "peak_force_layer_4_n"), nullptr);
  EXPECT_EQ(valueOf(score, "entries"), 1);
  EXPECT_EQ(valueOf(score, "withdrawals"), 1);
  EXPECT_EQ(valueOf(score, "trajectory_changes"), 0);
  EXPECT_EQ(find(score, "peak_force_layer_2_n")->words, "Peak force in muscle 2 N");
}

TEST(Tissue, aLayersNameIsInItsTextItsNumberInItsKey) {
  pb::Profile profile = halfSpace();
  profile.mutable_layers(1)->set_name("dura");
  const auto named = scoreGesture(inAndOut(1000), 1000, profile, {});
  EXPECT_EQ(find(named, "peak_force_layer_2_n")->words, "Peak force in dura 2 N");
  EXPECT_EQ(find(named, "mean_force_layer_2_n")->words, "Mean force in dura 2 N");
  EXPECT_EQ(find(named, "peak_force_layer_1_n")->words, "Peak force in skin 1 N");
  // names, values and units of all rows are unchanged
  const auto plain = scoreGesture(inAndOut(1000), 1000, halfSpace(), {});
  ASSERT_EQ(named.size(), plain.size());
  for (std::size_t i = 0; i < plain.size(); ++i) {
    EXPECT_EQ(named[i].name, plain[i].name);
    EXPECT_EQ(named[i].value, plain[i].value);
    EXPECT_EQ(named[i].unit, plain[i].unit);
  }
}

TEST(Tissue, layersOfOneTissueHaveDistinctTexts) {
  pb::Profile profile = halfSpace();
  profile.mutable_layers(1)->set_tissue(pb::Layer::FAT);
  profile.mutable_layers(2)->set_tissue(pb::Layer::FAT);
  auto score = scoreGesture(inAndOut(1000), 1000, profile, {});
  EXPECT_EQ(find(score, "peak_force_layer_2_n")->words, "Peak force in fat 1 2 N");
  EXPECT_EQ(find(score, "peak_force_layer_3_n")->words, "Peak force in fat 2 3 N");
  profile.mutable_layers(2)->set_tissue(pb::Layer::OTHER);
  score = scoreGesture(inAndOut(1000), 1000, profile, {});
  EXPECT_EQ(find(score, "peak_force_layer_3_n")->words, "Peak force in layer 3 3 N");
}

TEST(Tissue, meanForceIsOverTimeNotOverSamples) {
  // 1 N for 1 s with every tick present, then 3 N for 1 s with every tenth
  auto samples = gesture(1000, 2, [](double t, GestureSample& s) {
    setDepth(s, 0.01);
    s.force_W_N[0] = t < 1 ? 1 : 3;
  });
  std::vector<GestureSample> thinned;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (i < 1000 || i % 10 == 0) thinned.push_back(samples[i]);
  }
  EXPECT_NEAR(valueOf(scoreGesture(thinned, 1000, halfSpace(), {}), "mean_force_in_tissue_n"), 2, 0.01);
}

TEST(Tissue, theForceOutsideIsNoForceInTissue) {
  const auto samples = gesture(1000, 2, [](double t, GestureSample& s) {
    setDepth(s, t < 1 ? -0.01 : 0.01);
    s.force_W_N[1] = t < 1 ? -4 : 1;
  });
  const auto score = scoreGesture(samples, 1000, halfSpace(), {});
  EXPECT_EQ(valueOf(score, "peak_force_n"), 4);
  EXPECT_EQ(valueOf(score, "mean_force_in_tissue_n"), 1);
  EXPECT_EQ(valueOf(score, "peak_force_layer_2_n"), 1);
  EXPECT_EQ(find(score, "peak_force_layer_1_n"), nullptr) << "never there";
}

TEST(Tissue, entriesWithdrawalsAndTurnsAreCountedAsEvents) {
  // three insertions; in the second: in, back, stop, back, in, back = two withdrawals
  const auto at = [](double t, GestureSample& s) {
    const int second = static_cast<int>(t);
    setDepth(s, second % 2 == 1 ? 0.01 : -0.01);
    if (second == 3) {
      const Phase phases[] = {Phase::kInserting,   Phase::kWithdrawing, Phase::kStopped,
                              Phase::kWithdrawing, Phase::kInserting,   Phase::kWithdrawing};
      s.phase = static_cast<std::uint8_t>(phases[static_cast<int>((t - 3) * 6)]);
    }
    // turns at 1.1–1.2 and 1.3–1.35 s (a pause of 0.1 s: one change), and another one at 1.6 s
    const bool turns = (t >= 1.1 && t < 1.2) || (t >= 1.3 && t < 1.35) || (t >= 1.6 && t < 1.601);
    if (turns) s.flags |= kFlagTurn;
  };
  const auto score = scoreGesture(gesture(1000, 6, at), 1000, halfSpace(), {});
  EXPECT_EQ(valueOf(score, "entries"), 3);
  EXPECT_EQ(valueOf(score, "withdrawals"), 2);
  EXPECT_EQ(valueOf(score, "trajectory_changes"), 2);
}

TEST(Tissue, anExitInMissingTicksIsSeenByTheEntryFlag) {
  auto samples =
      gesture(1000, 1, [](double t, GestureSample& s) { setDepth(s, t < 0.4 || t > 0.45 ? 0.01 : -0.01); });
  samples.erase(samples.begin() + 395, samples.begin() + 460);
  samples[395].flags |= kFlagEntry;
  EXPECT_EQ(valueOf(scoreGesture(samples, 1000, halfSpace(), {}), "entries"), 2);
}

TEST(Tissue, lateralErrorCountsInTissueOnly) {
  const auto samples = gesture(1000, 1, [](double t, GestureSample& s) {
    setDepth(s, t < 0.5 ? 0.01 : -0.01);
    s.lateral_error_m = t < 0.5 ? 0.002 * t : 0.5;
  });
  EXPECT_NEAR(valueOf(scoreGesture(samples, 1000, halfSpace(), {}), "largest_lateral_error_m"), 0.000998,
              1e-9);
}

TEST(Tissue, aDetourIsInefficient) {
  // 20 mm down along a half circle; the path ends 0.25 mm above its deepest point: arc divided by chord
  const auto samples = gesture(1000, 4, [](double t, GestureSample& s) {
    const double phi = std::numbers::pi * ease(t, 4);
    setDepth(s, 0.01 * (1 - std::cos(phi)) + 1e-9);
    setTip(s, {0, 0.01 * std::sin(phi), -0.01 * (1 - std::cos(phi))});
  });
  const double angle = std::acos(1 - (0.02 - 0.25e-3) / 0.01);
  EXPECT_NEAR(valueOf(scoreGesture(samples, 1000, halfSpace(), {}), "path_inefficiency"),
              angle / (2 * std::sin(angle / 2)), 5e-3);
}

TEST(Aim, theTargetsDistanceAndTime) {
  pb::Profile profile = halfSpace();
  addTarget(profile, {0.001, 0, -0.024}, 0.002);
  const auto score = scoreGesture(inAndOut(1000), 1000, profile, {});
  EXPECT_EQ(valueOf(score, "target_reached"), 1);
  EXPECT_NEAR(valueOf(score, "target_distance_m"), std::sqrt(2.0) * 0.001, 1e-9);
  EXPECT_NEAR(valueOf(score, "target_nearest_m"), 0.001, 1e-6);
  // within 2 mm while z is below −24 + √3 mm: between those two moments of the ease, including the rest
  const double share = (0.02 + 0.024 - 0.001 * std::sqrt(3.0)) / 0.045;
  double low = 0.5, high = 1;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (ease(middle, 1) < share ? low : high) = middle;
  }
  EXPECT_NEAR(valueOf(score, "time_at_target_s"), 1 + 2 * (2 - 2 * low), 3e-3);
}

TEST(Aim, aMissedTargetGivesItsDistance) {
  pb::Profile profile = halfSpace();
  addTarget(profile, {0, 0, -0.03}, 0.003);
  const auto score = scoreGesture(inAndOut(1000), 1000, profile, {});
  EXPECT_EQ(valueOf(score, "target_reached"), 0);
  EXPECT_EQ(valueOf(score, "time_at_target_s"), 0);
  EXPECT_NEAR(valueOf(score, "target_distance_m"), 0.005, 1e-9);
}

TEST(Aim, theFinalDistanceIsThatOfTheLastInsertion) {
  pb::Profile profile = halfSpace();
  addTarget(profile, {0, 0, -0.02}, 0.001);
  // first to 20 mm, out, then to 15 mm and out
  const auto samples = gesture(1000, 4, [](double t, GestureSample& s) {
    const double depth = t < 2 ? 0.02 : 0.015;
    setDepth(s, depth * std::sin(std::numbers::pi * std::fmod(t, 2.0) / 2) - 0.001);
  });
  const auto score = scoreGesture(samples, 1000, profile, {});
  EXPECT_NEAR(valueOf(score, "target_distance_m"), 0.006, 1e-6);
  EXPECT_NEAR(valueOf(score, "target_nearest_m"), 0.001, 1e-6);
}

TEST(Aim, tipAndShaftTouchHazards) {
  pb::Profile profile = halfSpace();
  addBallHazard(profile, "tip's", {0, 0, -0.026}, 0.0011);  // its top at 24.9 mm: the tip reaches 25 mm
  addBallHazard(profile, "out of reach", {0, 0, -0.026}, 0.0009);  // its top at 25.1 mm
  addBallHazard(profile, "the shaft's", {0.002, 0, -0.01}, 0.002);
  addBallHazard(profile, "beside", {0.002, 0, -0.01}, 0.0019);
  addBallHazard(profile, "above the skin", {0, 0, 0.01}, 0.005);
  const auto score = scoreGesture(inAndOut(1000), 1000, profile, {});
  EXPECT_EQ(valueOf(score, "hazards_touched"), 2);
  EXPECT_THAT(find(score, "hazards_touched")->words, ::testing::HasSubstr("(tip's, the shaft's)"));
}

TEST(Aim, eachEntryOfTheTipIntoBoneIsAContact) {
  // 25 mm deep, with bone from 20 mm on
  pb::Profile profile = halfSpace();
  const auto once = inAndOut(1000);
  EXPECT_EQ(valueOf(scoreGesture(once, 1000, profile, {}), "bone_contacts"), 1);
  EXPECT_EQ(valueOf(scoreGesture(once, 1000, profile, {}), "hazards_touched"), 0)
      << "a layer is not a hazard";

  profile.mutable_layers(2)->set_tissue(pb::Layer::MUSCLE);
  addBallHazard(profile, "head", {0, 0, -0.026}, 0.0011);      // its top at 24.9 mm: the tip reaches 25 mm
  addBallHazard(profile, "beside", {0.002, 0, -0.01}, 0.002);  // the shaft lies along it
  for (auto& hazard : *profile.mutable_hazards()) hazard.set_kind(pb::Hazard::BONE);
  const auto score = scoreGesture(once, 1000, profile, {});
  EXPECT_EQ(valueOf(score, "hazards_touched"), 2);
  EXPECT_EQ(valueOf(score, "bone_contacts"), 1) << "the tip's";
}

TEST(Aim, eachFullInsertionToTheHubIsAContact) {
  // a needle of 20 mm inserted 25 mm deep, 5 s after another such insertion
  const auto score = [](const std::vector<GestureSample>& samples) {
    return valueOf(scoreGesture(samples, 1000, halfSpace(), {}), "hub_contacts");
  };
  auto once = inAndOut(1000);
  EXPECT_EQ(score(once), 0) << "never in to the hub";
  for (GestureSample& sample : once)
    if (sample.insertion_m > 0.02) sample.flags |= kFlagBeyondNeedle;
  EXPECT_EQ(score(once), 1);
  auto twice = once;
  for (GestureSample sample : once) {
    sample.tick += 5001;
    twice.push_back(sample);
  }
  EXPECT_EQ(score(twice), 2);
}

TEST(Aim, tremorOfTheHubOnTheSkinIsOneContact) {
  // at rest for 3 s with the hub on the skin, with a tremor of 50 µm at 10 Hz
  constexpr double kNeedle_m = 0.02;
  auto samples = gesture(1000, 5, [](double t, GestureSample& s) {
    const double tremor_m = 5e-5 * std::sin(2 * std::numbers::pi * 10 * t);
    setDepth(s, -0.01 + (0.01 + kNeedle_m) * (ease(t, 1) - ease(t - 4, 1)) + tremor_m);
    if (s.insertion_m > kNeedle_m) s.flags |= kFlagBeyondNeedle;
  });
  EXPECT_EQ(valueOf(scoreGesture(samples, 1000, halfSpace(), {}), "hub_contacts"), 1);
  // 0.5 s of ticks that were not stepped do not mean that it left
  for (std::size_t i = 2025; i < 2525; ++i) samples[i].flags = kFlagNotStepped;
  EXPECT_EQ(valueOf(scoreGesture(samples, 1000, halfSpace(), {}), "hub_contacts"), 1);
}

TEST(Measures, missedTicksChangeLittle) {
  pb::Profile profile = halfSpace();
  addTarget(profile, {0, 0, -0.024}, 0.002);
  const auto whole = inAndOut(1000);
  std::mt19937_64 random(5);
  std::vector<GestureSample> holed;
  for (const auto& sample : whole) {
    if (holed.empty() || random() % 10 >= 3) holed.push_back(sample);  // three in ten are missing
  }
  const auto a = scoreGesture(whole, 1000, profile, {});
  const auto b = scoreGesture(holed, 1000, profile, {});
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    // SPARC ends at the last frequency above its threshold: a tiny change in the spectrum can shift that end
    const double share = a[i].name == "sparc" ? 2e-2 : 5e-3;
    EXPECT_NEAR(a[i].value, b[i].value, share * std::abs(a[i].value) + 1e-6) << a[i].name;
  }
}

TEST(Measures, nothingIsAssumedOfALongGap) {
  // the tip jumps 1 m during 2 s without ticks
  auto samples = gesture(1000, 1, [](double t, GestureSample& s) { setTip(s, {0.01 * t, 0, 0.1}); });
  const auto after = gesture(1000, 1, [](double t, GestureSample& s) { setTip(s, {1 + 0.01 * t, 0, 0.1}); });
  for (GestureSample sample : after) {
    sample.tick += 3000;
    samples.push_back(sample);
  }
  const auto score = scoreGesture(samples, 1000, halfSpace(), {});
  EXPECT_NEAR(valueOf(score, "elapsed_s"), 4, 1e-12);
  EXPECT_NEAR(valueOf(score, "path_length_m"), 0.02, 1e-12);
  EXPECT_NEAR(valueOf(score, "mean_speed_m_s"), 0.01, 1e-12);
}

TEST(Measures, ofNothingAreZeros) {
  pb::Profile profile = halfSpace();
  addTarget(profile, {0, 0, -0.02}, 0.001);
  for (const std::size_t count : {0u, 1u, 2u}) {
    const auto samples = gesture(1000, 1, [](double, GestureSample&) {});
    const auto score = scoreGesture(std::span(samples).first(count), 1000, profile, {});
    EXPECT_EQ(valueOf(score, "path_length_m"), 0);
    EXPECT_EQ(valueOf(score, "elapsed_s"), count == 2 ? 0.001 : 0);
    EXPECT_EQ(valueOf(score, "target_reached"), 0);
    EXPECT_EQ(find(score, "target_distance_m"), nullptr);
    EXPECT_EQ(find(score, "sparc"), nullptr);
  }
}

TEST(Measures, aSingleSampleInTissueCounts) {
  const auto samples = gesture(1000, 0, [](double, GestureSample& s) {
    setDepth(s, 0.01);
    s.force_W_N[0] = 2;
  });
  ASSERT_EQ(samples.size(), 1u);
  const auto score = scoreGesture(samples, 1000, halfSpace(), {});
  EXPECT_EQ(valueOf(score, "entries"), 1);
  EXPECT_EQ(valueOf(score, "peak_force_n"), 2);
  EXPECT_EQ(valueOf(score, "mean_force_in_tissue_n"), 0) << "it lasted no time";
}

TEST(Measures, anImpossibleRateGivesNone) {
  const auto samples = inAndOut(1000);
  for (const double rate : {0.0, -1000.0, 49.9, 40'001.0, std::nan("")}) {
    EXPECT_TRUE(scoreGesture(samples, rate, halfSpace(), {}).empty());
  }
}

TEST(Measures, randomBitsGiveOnlyFiniteNumbers) {
  std::mt19937_64 random(9);
  pb::Profile profile = halfSpace();
  addTarget(profile, {0, 0, -0.02}, 0.001);
  addBallHazard(profile, "ball", {0, 0, -0.01}, 0.01);
  for (int round = 0; round < 30; ++round) {
    auto samples = inAndOut(500);
    for (int change = 0; change < 300; ++change) {
      // eight random bytes anywhere in a sample, or one flipped bit
      auto* bytes = reinterpret_cast<unsigned char*>(&samples[random() % samples.size()]);
      const std::size_t at = random() % (sizeof(GestureSample) - 8);
      const std::uint64_t noise = random();
      if (change % 2 == 0)
        std::memcpy(bytes + at, &noise, 8);
      else
        bytes[at] ^= static_cast<unsigned char>(1u << (noise % 8));
    }
    const auto score = scoreGesture(samples, 1000, profile, {});
    EXPECT_FALSE(score.empty());
    for (const Measure& measure : score) EXPECT_TRUE(std::isfinite(measure.value)) << measure.name;
  }
}

// A ball of bone, its top 16 mm below the skin; the cap is 3 mm thick.
TEST(Landmark, isFoundWhenTheCappedTipIsTheCapsRadiusFromIt) {
  nlohmann::json tree = test::withCyst();
  tree["volume"]["structures"].back()["layer"]["tissue"] = "BONE";
  tree["targets"] = tree["hazards"] = nlohmann::json::array();
  tree["palpation"] = {{"skin_stiffness_n_per_m", 300},
                       {"bone_stiffness_n_per_m", 600},
                       {"friction_coefficient", 0.3},
                       {"radius_m", 0.003},
                       {"landmark", "cyst"}};
  const pb::Profile profile = test::readProfile(tree);
  const auto never = gesture(1000, 2, [](double t, GestureSample& s) {
    setTip(s, {test::kCyst_m.x, test::kCyst_m.y, -0.0065 * t});
    s.flags |= kFlagCapped;
  });
  EXPECT_EQ(find(scoreGesture(never, 1000, profile, {}), "landmark_s"), nullptr) << "13 mm are not reached";
  const auto late = gesture(1000, 3, [](double t, GestureSample& s) {
    setTip(s, {test::kCyst_m.x, test::kCyst_m.y, t < 1 ? -0.02 : 0.01 - 0.02 * (t - 1)});
    if (t >= 1) s.flags |= kFlagCapped;  // the first second without the cap does not count
  });
  EXPECT_NEAR(valueOf(scoreGesture(late, 1000, profile, {}), "landmark_s"), 1 + 0.023 / 0.02, 1.1e-3);
}

TEST(Measures, everyRowsNameIsKnownAndEveryKnownNameOccurs) {
  pb::Profile profile = halfSpace();
  addTarget(profile, {0, 0, -0.02}, 0.001);
  // The syringe adds rows if there was an injection in tissue.
  auto samples = inAndOut(1000);
  bool inside = false;
  for (auto& sample : samples) {
    inside = inside || (sample.layer == 1);
    sample.plunger = inside ? 0.5 : 0.1;
  }
  pb::Exercise exercise;  // without a plan there are no errors relative to one
  exercise.mutable_plan()->mutable_direction()->set_z(-1);
  const auto score = scoreGesture(samples, 1000, profile, {}, &exercise);
  EXPECT_EQ(score.size(), measureKinds().size() - 5 + 3 + 3)
      << "all but what is missing, the distance from references and the time to the landmark; the two forces of three layers each";
  std::vector<std::string> names;
  for (const Measure& measure : score) {
    EXPECT_TRUE(isMeasureName(measure.name)) << measure.name;
    EXPECT_FALSE(measure.words.empty());
    names.push_back(measure.name);
  }
  std::sort(names.begin(), names.end());
  EXPECT_EQ(std::adjacent_find(names.begin(), names.end()), names.end()) << "no name twice";
}

TEST(Actions, movementsArePartedByRest) {
  // three movements of 30 mm within 1 s each, with rests of 0.5 s; the last one of 1 mm is not a movement
  const auto samples = gesture(1000, 7, [](double t, GestureSample& s) {
    const double x = 0.03 * (ease(t, 1) + ease(t - 1.5, 1) - ease(t - 3, 1)) + 0.001 * ease(t - 5, 0.3);
    setTip(s, {x, 0, 0.1});
  });
  const auto score = scoreGesture(samples, 1000, halfSpace(), {});
  EXPECT_EQ(valueOf(score, "translational_actions"), 3);
  EXPECT_EQ(valueOf(score, "rotational_actions"), 0);
}

TEST(Actions, aShortHesitationPartsNothing) {
  // 40 mm/s with stops of 50 ms: shorter than a separating pause, and blurred by the filter
  const auto samples = gesture(1000, 2, [](double t, GestureSample& s) {
    const double cycle = std::floor(t / 0.5), within = t - 0.5 * cycle;
    setTip(s, {0.04 * (0.45 * cycle + std::min(within, 0.45)), 0, 0.1});
  });
  EXPECT_EQ(valueOf(scoreGesture(samples, 1000, halfSpace(), {}), "translational_actions"), 1);
}

TEST(Actions, turnsOfTheAxisCountAndRollingDoesNot) {
  const auto turned = [](bool roll) {
    const auto samples = gesture(1000, 5, [&](double t, GestureSample& s) {
      const double angle = 0.3 * (ease(t - 0.5, 1) - ease(t - 2.5, 1));
      setDown(s, roll ? 0 : angle);
      if (!roll) return;
      const Quat q =
          Quat{s.q_WT[0], s.q_WT[1], s.q_WT[2], s.q_WT[3]} * Quat{0, 0, std::sin(angle), std::cos(angle)};
      s.q_WT[0] = q.x, s.q_WT[1] = q.y, s.q_WT[2] = q.z, s.q_WT[3] = q.w;
    });
    return valueOf(scoreGesture(samples, 1000, halfSpace(), {}), "rotational_actions");
  };
  EXPECT_EQ(turned(false), 2);
  EXPECT_EQ(turned(true), 0);
}

TEST(Actions, tremorAtRestIsNoMovement) {
  for (const double amplitude_m : {50e-6, 200e-6}) {
    const auto samples = gesture(1000, 5, [&](double t, GestureSample& s) {
      setTip(s, {amplitude_m * std::sin(2 * std::acos(-1.0) * 9 * t), 0, 0.1});
    });
    EXPECT_EQ(valueOf(scoreGesture(samples, 1000, halfSpace(), {}), "translational_actions"), 0)
        << amplitude_m;
  }
}

TEST(Actions, workAgainstASpringAcrossTheNeedle) {
  // 400 N/m sideways: 5 mm out and back. ½·k·d² once: the energy that the spring returns is not subtracted.
  // Forces and motion along the needle do not count.
  const auto work = [](double friction_N, double way_m) {
    const auto samples = gesture(1000, 4, [&](double t, GestureSample& s) {
      const double y = 0.005 * (ease(t, 1.5) - ease(t - 2, 1.5));
      setDepth(s, 0.02);
      setTip(s, {0, y, -0.02 - way_m * ease(t, 4)});
      s.force_W_N[1] = -400 * y;
      s.force_W_N[2] = friction_N;
    });
    return valueOf(scoreGesture(samples, 1000, halfSpace(), {}), "clamping_work_j");
  };
  const double spring_J = 0.5 * 400 * 0.005 * 0.005;
  EXPECT_NEAR(work(0, 0), spring_J, 0.01 * spring_J);
  EXPECT_NEAR(work(8, 0.008), spring_J, 0.01 * spring_J);
  // no work outside tissue
  const auto outside = gesture(1000, 4, [](double t, GestureSample& s) {
    setTip(s, {0, 0.005 * ease(t, 4), 0.1});
    s.force_W_N[1] = -2;
  });
  EXPECT_EQ(valueOf(scoreGesture(outside, 1000, halfSpace(), {}), "clamping_work_j"), 0);
}

TEST(Tissue, meanForceOfEachLayer) {
  // 1, 2, 3 N by layer
  const auto score = scoreGesture(inAndOut(1000), 1000, halfSpace(), {});
  EXPECT_NEAR(valueOf(score, "mean_force_layer_1_n"), 1, 1e-9);
  EXPECT_NEAR(valueOf(score, "mean_force_layer_2_n"), 2, 1e-9);
  EXPECT_NEAR(valueOf(score, "mean_force_layer_3_n"), 3, 1e-9);
  EXPECT_EQ(find(score, "mean_force_layer_2_n")->words, "Mean force in muscle 2 N");
  // a layer that was never reached has no mean
  const auto shallow = gesture(1000, 1, [](double, GestureSample& s) { setDepth(s, 0.005); });
  EXPECT_EQ(find(scoreGesture(shallow, 1000, halfSpace(), {}), "mean_force_layer_2_n"), nullptr);
}

}  // namespace

}  // namespace needlelab
