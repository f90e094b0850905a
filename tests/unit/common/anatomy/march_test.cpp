/// The layers along a line: by formula where there is one, and against a march of 0.02 mm that asks the field
/// alone.
#include "common/anatomy/march.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/support/anatomy/fields.h"

namespace needlelab::test {
namespace {

constexpr double kNear_m = 2 * kBoundary_m;

struct Wanted {
  const char* structure;
  double top_m;
};

void expectStack(const Field& field, const LayerStack& stack, const std::vector<Wanted>& wanted) {
  ASSERT_EQ(stack.count, wanted.size());
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    EXPECT_EQ(field.structures()[stack.layers[i].structure].id, wanted[i].structure) << i;
    EXPECT_NEAR(stack.layers[i].top_m, wanted[i].top_m, kNear_m) << i << ", " << wanted[i].structure;
  }
}

TEST(March, meetsLayersOfASlabAtDepthOverCosine) {
  const Field field = fieldOf(slab());
  for (const double degrees : {0.0, 30.0, 60.0, 75.0}) {
    const double angle = degrees * 3.14159265358979 / 180, c = std::cos(angle);
    const LayerStack stack = march(field, {}, {std::sin(angle), 0, -c}, {.reach_m = 0.06});
    SCOPED_TRACE(degrees);
    expectStack(field, stack, {{"dermis", 0}, {"fat", 2e-3 / c}, {"fascia", 8e-3 / c}, {"muscle", 9e-3 / c}});
    EXPECT_EQ(stack.end, StackEnd::kReach);
    EXPECT_EQ(stack.end_m, 0.06);
  }
}

// a ball of 30 mm with shells of 5 mm, passed 10 mm beside its centre: chords by Pythagoras
TEST(March, meetsEachShellOfABallTwiceAndLeaves) {
  FieldSpec spec;
  spec.groups = {{"skin", {ball({}, 30)}}};
  spec.structures = {structure("shell"), structure("core")};
  spec.rules = {rule("skin", -5, 0, "shell")};
  spec.skin = "skin";
  spec.rest = "core";
  const Field field = fieldOf(spec);
  const double half = std::sqrt(30.0 * 30 - 10 * 10), inner = std::sqrt(25.0 * 25 - 10 * 10);
  const std::optional<double> entry_m = findEntry(field, mm(10, 0, 50), {0, 0, -1}, 0.1);
  ASSERT_TRUE(entry_m);
  EXPECT_NEAR(*entry_m, (50 - half) * 1e-3, kNear_m);
  const LayerStack stack = march(field, mm(10, 0, 50 - *entry_m * 1e3), {0, 0, -1}, {.reach_m = 0.2});
  expectStack(field, stack,
              {{"shell", 0}, {"core", (half - inner) * 1e-3}, {"shell", (half + inner) * 1e-3}});
  EXPECT_EQ(stack.end, StackEnd::kExit);
  EXPECT_NEAR(stack.end_m, 2 * half * 1e-3, kNear_m);
}

// a vessel of 3 mm across the path at 40 degrees: its chord is the diameter over the sine
TEST(March, crossesATubeOnAChordByFormula) {
  FieldSpec spec = slab();
  const double angle = 40 * 3.14159265358979 / 180, s = std::sin(angle), c = std::cos(angle);
  spec.groups.push_back({"vessel",
                         {{TubePart{{{Vec3{-0.1 * c, 0, -0.03 - 0.1 * s}, 1.5e-3},
                                     {Vec3{0.1 * c, 0, -0.03 + 0.1 * s}, 1.5e-3}}}}}});
  spec.structures.push_back(structure("vessel"));
  spec.rules.insert(spec.rules.begin(), rule("vessel", -kNoBound, 0, "vessel"));
  const Field field = fieldOf(spec);
  const LayerStack stack = march(field, {}, {0, 0, -1}, {.reach_m = 0.05});
  expectStack(field, stack,
              {{"dermis", 0},
               {"fat", 2e-3},
               {"fascia", 8e-3},
               {"muscle", 9e-3},
               {"vessel", 0.03 - 1.5e-3 / c},
               {"muscle", 0.03 + 1.5e-3 / c}});
}

TEST(March, endsAtTheFirstBone) {
  FieldSpec spec = slab();
  spec.groups.push_back({"bone", {ellipsoid(mm(0, 0, -30), mm(20, 20, 10))}});
  spec.structures.push_back(structure("bone", true));
  spec.rules.insert(spec.rules.begin(), rule("bone", -kNoBound, 0, "bone"));
  const Field field = fieldOf(spec);
  // beside the centre by 12 mm, the ellipsoid's top is at 10·√(1 − 0.36)
  const LayerStack stack = march(field, mm(12, 0, 0), {0, 0, -1}, {.reach_m = 0.06});
  expectStack(field, stack,
              {{"dermis", 0}, {"fat", 2e-3}, {"fascia", 8e-3}, {"muscle", 9e-3}, {"bone", 22e-3}});
  EXPECT_EQ(stack.end, StackEnd::kBone);
  EXPECT_NEAR(stack.end_m, 22e-3, kNear_m);
}

TEST(March, givesASliverToTheLayerBeforeAndRejoinsIt) {
  FieldSpec spec = slab();
  spec.groups.push_back({"sheet", {halfSpace(mm(0, 0, -20), {0, 0, 1})}});
  spec.structures.push_back(structure("sheet"));
  spec.rules.insert(spec.rules.begin(), rule("sheet", -0.3, 0, "sheet"));
  const Field field = fieldOf(spec);
  const LayerStack felt = march(field, {}, {0, 0, -1}, {.reach_m = 0.05, .min_layer_m = 0.25e-3});
  expectStack(field, felt,
              {{"dermis", 0},
               {"fat", 2e-3},
               {"fascia", 8e-3},
               {"muscle", 9e-3},
               {"sheet", 20e-3},
               {"muscle", 20.3e-3}});
  const LayerStack not_felt = march(field, {}, {0, 0, -1}, {.reach_m = 0.05, .min_layer_m = 0.35e-3});
  expectStack(field, not_felt, {{"dermis", 0}, {"fat", 2e-3}, {"fascia", 8e-3}, {"muscle", 9e-3}});
}

TEST(March, givesASliverUnderTheSkinToTheLayerBehindIt) {
  FieldSpec spec = slab();
  spec.rules[0] = rule("skin", -0.2, 0, "dermis");
  spec.rules[1] = rule("skin", -8, -0.2, "fat");
  const Field field = fieldOf(spec);
  expectStack(field, march(field, {}, {0, 0, -1}, {.reach_m = 0.05}),
              {{"fat", 0}, {"fascia", 8e-3}, {"muscle", 9e-3}});
}

TEST(March, alongTheSkinEndsAtOnceOutside) {
  const Field field = fieldOf(slab());
  const LayerStack stack = march(field, {}, {1, 0, 0}, {.reach_m = 0.05});
  EXPECT_EQ(stack.count, 0u);
  EXPECT_EQ(stack.end, StackEnd::kExit);
  EXPECT_EQ(stack.end_m, 0);
}

TEST(March, stopsWhenTheStackIsFullAndSaysWhere) {
  FieldSpec spec = slab();
  spec.rules.clear();
  for (int i = 0; i < 40; ++i)
    spec.rules.push_back(rule("skin", -i - 1.0, -i, i % 2 == 0 ? "fat" : "fascia"));
  const Field field = fieldOf(spec);
  const LayerStack stack = march(field, {}, {0, 0, -1}, {.reach_m = 0.1});
  EXPECT_EQ(stack.count, kMaxStackLayers);
  EXPECT_EQ(stack.end, StackEnd::kFull);
  EXPECT_NEAR(stack.end_m, 32e-3, kNear_m);
}

TEST(March, findsNoEntryFromInsideOrPastThePatient) {
  FieldSpec spec = slab();
  spec.groups[0].parts = {ball({}, 30)};
  const Field field = fieldOf(spec);
  EXPECT_FALSE(findEntry(field, mm(0, 0, 10), {0, 0, -1}, 0.1)) << "from inside";
  EXPECT_FALSE(findEntry(field, mm(31, 0, 50), {0, 0, -1}, 0.1)) << "beside";
  EXPECT_FALSE(findEntry(field, mm(0, 0, 200), {0, 0, -1}, 0.1)) << "too far";
}

// straight down through planes, the bounds of a stretch are met to the last bit
TEST(March, findsABoundaryAtAnyDepth) {
  for (int i = 0; i < 4000; ++i) {
    const double depth_mm = 2 + 0.01 * i;
    FieldSpec spec = slab();
    spec.groups.push_back({"bone", {halfSpace(mm(0, 0, -depth_mm - 1.03), {0, 0, 1})}});
    spec.structures.push_back(structure("bone", true));
    spec.rules = {rule("bone", -kNoBound, 0, "bone"), rule("skin", -depth_mm, kNoBound, "fat")};
    const LayerStack stack = march(fieldOf(spec), {}, {0, 0, -1}, {.reach_m = 0.05});
    ASSERT_EQ(stack.count, 3u) << depth_mm;
    ASSERT_NEAR(stack.layers[1].top_m, 1e-3 * depth_mm, kNear_m);
    ASSERT_NEAR(stack.end_m, 1e-3 * (depth_mm + 1.03), kNear_m);
    ASSERT_EQ(stack.end, StackEnd::kBone) << depth_mm;
  }
}

// Two balls beside the line pull a third one's surface towards it, each by its blend. Independent: the whole
// field every 0.01 mm.
TEST(March, findsAnOrganThatBlendsInAChain) {
  for (double under_mm = 4; under_mm < 26; under_mm += 0.05) {
    FieldSpec spec = slab();
    spec.groups.push_back(
        {"organ",
         {ball(mm(22.63, 0, -under_mm - 20), 10), ball(mm(-22.63, 0, -under_mm - 20), 10, 20),
          ball(mm(0, 0, -under_mm - 100), 100, 20)}});
    spec.structures.push_back(structure("organ"));
    spec.rules = {rule("organ", -kNoBound, 0, "organ")};
    const Field field = fieldOf(spec);
    double wanted_m = 0;
    while (field.structures()[field.at({0, 0, -wanted_m - 1e-9}).structure].id != "organ") wanted_m += 1e-5;
    ASSERT_LT(wanted_m, 1e-3 * under_mm - 0.1e-3) << "control: they do pull";
    const LayerStack stack = march(field, {}, {0, 0, -1}, {.reach_m = 0.05});
    ASSERT_EQ(stack.count, 2u) << under_mm;
    ASSERT_NEAR(stack.layers[1].top_m, wanted_m, 1.1e-5) << under_mm;
  }
}

// independent: asks the whole field every 0.02 mm, without lines, clearances or halving
TEST(March, agreesWithTheFieldApartFromBoundariesAndSlivers) {
  const Field field = fieldOf(forearm());
  Random random(21);
  int places = 0, layers = 0;
  for (int i = 0; i < 200; ++i) {
    const Line line = randomLine(random);
    const std::optional<double> entry_m = findEntry(field, line.from_m, line.axis, 0.05);
    if (!entry_m) continue;
    const Vec3 entry = line.from_m + line.axis * *entry_m;
    const LayerStack stack = march(field, entry, line.axis, {.reach_m = 0.03, .min_layer_m = 0});
    layers += static_cast<int>(stack.count);
    std::size_t layer = 0;
    for (double t_m = 0.11e-3; t_m < stack.end_m; t_m += 0.02e-3) {
      while (layer + 1 < stack.count && t_m >= stack.layers[layer + 1].top_m) ++layer;
      if (layer + 1 < stack.count && stack.layers[layer + 1].top_m - t_m < kNear_m) continue;
      if (t_m - stack.layers[layer].top_m < kNear_m) continue;
      ++places;
      const StructureIndex found = field.at(entry + line.axis * t_m).structure;
      if (found == stack.layers[layer].structure) continue;
      // only a layer thinner than a step may be missing
      std::size_t same = 0;
      for (double way_m = -0.1e-3; way_m <= 0.1e-3; way_m += 0.01e-3)
        same += field.at(entry + line.axis * (t_m + way_m)).structure == found;
      ASSERT_LE(same, 11u) << "path " << i << ", " << 1e3 * t_m << " mm: " << field.structures()[found].id
                           << " is missing";
    }
  }
  EXPECT_GT(places, 100'000);
  EXPECT_GT(layers, 1'000);
}

}  // namespace
}  // namespace needlelab::test
