/// A field at a point: distances by formula, rules in order, clearance.
#include "common/anatomy/field.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/anatomy/fields.h"

namespace needlelab::test {
namespace {

std::string structureAt(const Field& field, Vec3 p_m) {
  const StructureIndex index = field.at(p_m).structure;
  return index == kOutside ? "outside" : field.structures()[index].id;
}

Field onePart(FieldPart part) {
  FieldSpec spec;
  spec.groups = {{"skin", {std::move(part)}}};
  spec.structures = {structure("tissue")};
  spec.rules = {rule("skin", -60, -50, "tissue")};  // distances matter up to 60 mm
  spec.skin = "skin";
  spec.rest = "tissue";
  return fieldOf(spec);
}

TEST(FieldDistance, toAHalfSpaceIsAlongItsUnitNormal) {
  const Field field = onePart(halfSpace(mm(1, 2, 3), {0, 3, 4}));
  EXPECT_NEAR(field.distance(0, mm(7, 2 + 5 * 0.6, 3 + 5 * 0.8)), 5e-3, 1e-15);
}

TEST(FieldDistance, toACapsuleIsFromItsSegmentLessTheRadiusThere) {
  const Field field = onePart(capsule(mm(0, 0, 0), mm(0, 0, 40), 2, 6));
  EXPECT_NEAR(field.distance(0, mm(10, 0, 10)), (10 - 3) * 1e-3, 1e-15) << "a quarter of the way";
  EXPECT_NEAR(field.distance(0, mm(0, 3, -4)), (5 - 2) * 1e-3, 1e-15) << "before a";
  EXPECT_NEAR(field.distance(0, mm(0, 0, 50)), (10 - 6) * 1e-3, 1e-15) << "beyond b";
}

TEST(FieldDistance, toABallIsFromItsCentre) {
  EXPECT_NEAR(onePart(ball(mm(1, 1, 1), 4)).distance(0, mm(1, 13, 6)), 9e-3, 1e-15);
}

TEST(FieldDistance, toAnEllipsoidIsThatOfTheNearestPointOfItsSurface) {
  EllipsoidPart turned{mm(1, 0, 0), mm(10, 4, 2), {0, 1, 0}, {0, 0, 1}};  // x along Y, y along Z, z along X
  const Field field = onePart({turned});
  EXPECT_NEAR(field.distance(0, mm(1, 15, 0)), 5e-3, 1e-15);
  EXPECT_NEAR(field.distance(0, mm(1, 0, -7)), 3e-3, 1e-15);
  EXPECT_NEAR(field.distance(0, mm(4, 0, 0)), 1e-3, 1e-15);
  EXPECT_NEAR(field.distance(0, mm(1, 0, 0)), -2e-3, 2e-9) << "at its centre: the least radius";
  // a point off the surface along its normal there has that distance, as far as the centres of curvature
  Random random(2);
  for (int i = 0; i < 1'000; ++i) {
    const Vec3 way = normalized(randomPoint(random, {-1, -1, -1}, {1, 1, 1}));
    const Vec3 on{10 * way.y, 4 * way.z, 2 * way.x};  // along its axes
    const Vec3 normal = normalized(Vec3{on.x / 100, on.y / 16, on.z / 4});
    const double off_mm = random.in(-0.35, 30);  // least radius of curvature: 2²/10 mm
    const Vec3 p = on + normal * off_mm;
    ASSERT_NEAR(field.distance(0, mm(1 + p.z, p.x, p.y)), off_mm * 1e-3, 2e-9) << i;
  }
}

TEST(FieldDistance, ofATubeIsThatOfItsPiecesAndBranches) {
  const TubePart trunk{{{mm(0, 0, 0), 2e-3}, {mm(20, 0, 0), 2e-3}, {mm(20, 20, 0), 1e-3}}};
  const Field field = onePart({trunk});
  EXPECT_NEAR(field.distance(0, mm(10, 5, 0)), 3e-3, 1e-15);
  EXPECT_NEAR(field.distance(0, mm(15, 20, 0)), 4e-3, 1e-15);
  EXPECT_NEAR(field.distance(0, mm(24, 10, 0)), 2.5e-3, 1e-15) << "half way down the second piece: 1.5 mm";
}

TEST(FieldDistance, blendsByTheQuadraticSmoothMinimum) {
  FieldSpec spec = slab();
  spec.groups.push_back({"pair", {ball(mm(-10, 0, -50), 6), ball(mm(10, 0, -50), 6, 8)}});
  const Field field = fieldOf(spec);
  EXPECT_NEAR(field.distance(1, mm(0, 0, -50)), (4 - 8 / 4.0) * 1e-3, 1e-15)
      << "equal distances of 4 mm: k/4 less";
  EXPECT_NEAR(field.distance(1, mm(-1, 0, -50)), (3 - 6.0 * 6.0 / (4 * 8)) * 1e-3, 1e-15) << "3 and 5 mm";
  EXPECT_NEAR(field.distance(1, mm(-10, 0, -50)), -6e-3, 1e-15) << "far from the other: not changed";
}

TEST(Field, theFirstRuleThatHoldsDecidesAndTheRestIsTheRest) {
  FieldSpec spec = slab();
  spec.structures.push_back(structure("bone", true));
  spec.groups.push_back({"bone", {ball(mm(0, 0, -10), 4)}});
  spec.rules.insert(spec.rules.begin(), rule("bone", -kNoBound, 0, "bone"));
  const Field field = fieldOf(spec);
  EXPECT_EQ(structureAt(field, mm(0, 0, 1)), "outside");
  EXPECT_EQ(structureAt(field, mm(0, 0, 0)), "outside") << "the skin itself";
  EXPECT_EQ(structureAt(field, mm(20, 0, -1)), "dermis");
  EXPECT_EQ(structureAt(field, mm(20, 0, -2)), "dermis") << "[from, to): −2 mm is still the dermis";
  EXPECT_EQ(structureAt(field, mm(20, 0, -2.001)), "fat");
  EXPECT_EQ(structureAt(field, mm(0, 0, -7)), "bone") << "before the fat's rule";
  EXPECT_EQ(structureAt(field, mm(20, 0, -30)), "muscle");
}

TEST(Field, aClipConfinesARule) {
  FieldSpec spec = slab();
  spec.groups.push_back({"front", {halfSpace({}, {1, 0, 0})}});
  spec.rules[1].clips = {{"front", -5e-3, 0}};
  const Field field = fieldOf(spec);
  EXPECT_EQ(structureAt(field, mm(-1, 0, -4)), "fat");
  EXPECT_EQ(structureAt(field, mm(1, 0, -4)), "muscle");
  EXPECT_EQ(structureAt(field, mm(-6, 0, -4)), "muscle");
}

// the promise that lets a march take long steps
TEST(FieldClearance, everyPointNearerThanItIsOfTheSameStructure) {
  const Field field = fieldOf(forearm());
  Random random(4);
  int long_ones = 0;
  for (int i = 0; i < 20'000; ++i) {
    const Vec3 p_m = randomPoint(random, {-40, -35, -40}, {50, 35, 5});
    const FieldPoint point = field.at(p_m);
    ASSERT_GE(point.clearance_m, 0);
    if (point.clearance_m > 1e-3) ++long_ones;
    const Vec3 way = normalized(randomPoint(random, {-1, -1, -1}, {1, 1, 1}));
    const double share = random.in(0, 0.999999);
    ASSERT_EQ(field.at(p_m + way * (share * point.clearance_m)).structure, point.structure)
        << i << ": clearance " << point.clearance_m;
  }
  EXPECT_GT(long_ones, 4'000) << "a clearance of nothing would prove nothing";
}

/// Whether a slope is that of a distance, by differences along the axes; counts those across a ridge.
template <class Distance>
void expectSlope(const Distance& distance, Vec3 p_m, const FieldSlope& found, std::size_t& ridges) {
  for (const Vec3 axis : {Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}}) {
    constexpr double kStep_m = 1e-5;  // an ellipsoid is right within half a nanometre
    const double ahead = (distance(p_m + axis * kStep_m) - found.distance_m) / kStep_m,
                 behind = (found.distance_m - distance(p_m - axis * kStep_m)) / kStep_m;
    if (std::fabs(ahead - behind) > 2e-2)
      ++ridges;
    else
      ASSERT_NEAR(dot(found.slope, axis), 0.5 * (ahead + behind), 1e-3 + 0.5 * std::fabs(ahead - behind));
  }
}

TEST(FieldSlope, isThatOfTheDistanceAndHasItsBits) {
  const Field field = fieldOf(forearm());
  Random random(12);
  std::size_t ridges = 0, compared = 0;
  for (int i = 0; i < 20'000; ++i) {
    const Vec3 p_m = randomPoint(random, {-40, -35, -40}, {50, 35, 5});
    const auto mask = static_cast<StructureMask>(random.in(1, 255));
    const Field::InBall near = field.inBall(p_m, 0.02);
    const FieldSlope found = near.slope(mask, p_m);
    ASSERT_EQ(found.distance_m, near.structuresDistance(mask, p_m)) << i;
    compared += 3;
    expectSlope([&](Vec3 p) { return near.structuresDistance(mask, p); }, p_m, found, ridges);
    if (HasFatalFailure()) FAIL() << i;
  }
  EXPECT_GT(compared, 10'000u);
  EXPECT_LT(ridges, compared / 100) << "the field is smooth almost everywhere";
}

// Its sign is the structures', its slope that of its distances, and a ball's part has the bits of the whole.
TEST(FieldPiece, isTheWholeFieldsDistanceInItsBall) {
  const Field field = fieldOf(forearm());
  Random random(21);
  std::size_t steep = 0, inside = 0;
  for (int i = 0; i < 4'000; ++i) {
    const Vec3 p_m = randomPoint(random, {-40, -35, -40}, {50, 35, 15});
    const auto mask = i % 5 == 0 ? kWholeBody : static_cast<StructureMask>(random.in(1, 255));
    const Field::Piece whole = field.piece(mask);
    const Field::Piece ball = whole.within(p_m, random.in(0.001, 0.02)), less = ball.within(p_m, 0.0005);
    const FieldSlope found = whole.at(p_m);
    for (const Field::Piece& piece : {ball, less}) {
      ASSERT_EQ(piece.at(p_m).distance_m, found.distance_m) << i;
      ASSERT_EQ(piece.at(p_m).slope, found.slope) << i;
      const Vec3 aside = p_m + normalized(randomPoint(random, {-1, -1, -1}, {1, 1, 1})) * 0.0005;
      ASSERT_EQ(piece.at(aside).distance_m, whole.at(aside).distance_m) << i;
    }
    const StructureIndex here = field.at(p_m).structure;
    const bool is_in = here != kOutside && (mask & maskOf(here)) != 0;
    if (std::fabs(found.distance_m) > 1e-9) ASSERT_EQ(found.distance_m < 0, is_in) << i;
    inside += is_in ? 1 : 0;
    expectSlope([&](Vec3 p) { return whole.at(p).distance_m; }, p_m, found, steep);
    if (HasFatalFailure()) FAIL() << i;
  }
  EXPECT_GT(inside, 300u);
  EXPECT_LT(steep, 4'000u * 3 / 50) << "ridges are rare";
}

TEST(FieldOnLine, aStretchHasTheStructuresOfTheWholeField) {
  const Field field = fieldOf(forearm());
  Random random(9);
  for (int i = 0; i < 300; ++i) {
    const Line line = randomLine(random);
    const Field::OnLine on_line = field.onLine(line.from_m, line.axis);
    const double from_m = random.in(0, 0.04), to_m = from_m + random.in(0.001, 0.02);
    const Field::Stretch stretch = on_line.between(from_m, to_m);
    for (double t_m = from_m; t_m < to_m; t_m += 0.37e-3) {
      const FieldPoint here = stretch.at(t_m);
      ASSERT_EQ(here.structure, field.at(on_line.point(t_m)).structure) << i << " at " << t_m;
      const double free_m = std::min(t_m + 0.999999 * here.clearance_m, to_m);
      ASSERT_EQ(field.at(on_line.point(free_m)).structure, here.structure)
          << i << ": clearance " << here.clearance_m << " at " << t_m;
    }
  }
}

/// Groups of balls that blend in chains, and rules at, above and below their surfaces.
FieldSpec chains(Random& random) {
  FieldSpec spec = slab();
  for (const char* const group : {"one", "two", "three"}) {
    FieldGroup balls{group, {}};
    const int count = 3 + static_cast<int>(random.in(0, 4));
    for (int i = 0; i < count; ++i)
      balls.parts.push_back(ball(randomPoint(random, {-30, -30, -60}, {30, 30, -10}), random.in(2, 15),
                                 i == 0 ? 0 : random.in(0, 20)));
    spec.groups.push_back(balls);
    const double from_mm = random.in(-3, 1), to_mm = from_mm + random.in(0.5, 4);
    spec.rules.insert(spec.rules.begin(), rule(group, from_mm, to_mm, "fat"));
    spec.rules.insert(spec.rules.begin(), rule(group, -kNoBound, random.in(-2, 0), "fascia"));
  }
  return spec;
}

// What is left out must not change a bit of what decides: a ball far from the line still moves where the ones
// after it blend.
TEST(FieldOnLine, leavesOutNothingThatBlendsInAChain) {
  Random random(31);
  int decided = 0;
  for (int i = 0; i < 400; ++i) {
    const Field field = fieldOf(chains(random));
    const Vec3 from_m = randomPoint(random, {-40, -40, -5}, {40, 40, 0}),
               to_m = randomPoint(random, {-40, -40, -70}, {40, 40, -30});
    const Field::OnLine line = field.onLine(from_m, normalized(to_m - from_m));
    for (double begin_m = 0; begin_m < 0.06; begin_m += 0.006) {
      const double end_m = begin_m + 0.006;
      const Field::Stretch stretch = line.between(begin_m, end_m);
      const Field::InBall near = field.inBall(line.point(begin_m + 0.003), 0.003);
      for (int k = 0; k <= 60; ++k) {
        const double t_m = k == 60 ? end_m : begin_m + 1e-4 * k;
        const Vec3 p_m = line.point(t_m);
        const FieldPoint whole = field.at(p_m);
        ASSERT_EQ(stretch.at(t_m).structure, whole.structure) << i << " at " << t_m;
        ASSERT_EQ(near.at(p_m).structure, whole.structure) << i << " at " << t_m;
        decided += whole.clearance_m < 1e-4;
      }
    }
  }
  EXPECT_GT(decided, 3'000) << "places near a boundary";
}

}  // namespace
}  // namespace needlelab::test
