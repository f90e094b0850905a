#include "common/anatomy/tube_axes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

namespace needlelab::test {
namespace {

// a bent tube: level, up, aside; the corners are of 30 to 80 degrees
const std::vector<Vec3> kBends_m = {{0, 0, 0}, {0.03, 0.004, 0}, {0.05, 0.004, 0.025}, {0.05, 0.03, 0.05}};

FieldGroup tubeOf(const std::vector<Vec3>& points, double radius_m) {
  TubePart tube;
  for (const Vec3& point : points) tube.points.push_back({point, radius_m});
  return {"tube", {{tube}}};
}

/// A frame of the axis, carried along it in small steps: at each the reference loses what points along the
/// new tangent (Bishop's frame, numerically). Corners are walked as arcs.
struct Carried {
  Vec3 at_m, axis, zero;
  double along_m;
};
std::vector<Carried> carriedAlong(const std::vector<Vec3>& points) {
  constexpr int kSteps = 2000, kTurns = 20000;
  std::vector<Carried> frames;
  Vec3 zero;
  double along_m = 0;
  for (std::size_t i = 1; i < points.size(); ++i) {
    const Vec3 way = points[i] - points[i - 1], axis = way / norm(way);
    if (i == 1) {
      zero = Vec3{0, 0, 1};  // kBends_m begins level
    } else {
      const Vec3 before = frames.back().axis;
      for (int k = 1; k <= kTurns; ++k) {
        const Vec3 tangent = normalized(before + (axis - before) * (static_cast<double>(k) / kTurns));
        zero = normalized(zero - tangent * dot(zero, tangent));
      }
    }
    for (int k = 0; k <= kSteps; ++k)
      frames.push_back({points[i - 1] + way * (static_cast<double>(k) / kSteps), axis, zero,
                        along_m + norm(way) * k / kSteps});
    along_m += norm(way);
  }
  return frames;
}

TEST(TubeAxes, areThoseOfAFrameCarriedInSmallSteps) {
  const auto axes = TubeAxes::of(tubeOf(kBends_m, 0.004));
  ASSERT_TRUE(axes);
  const std::vector<Carried> frames = carriedAlong(kBends_m);
  int asked = 0;
  for (std::size_t i = 150; i < frames.size(); i += 400) {  // not at a corner
    for (int k = 0; k < 12; ++k) {
      const double angle_rad = -std::numbers::pi + (k + 0.5) * std::numbers::pi / 6,
                   radial_m = 0.0005 + 1e-4 * k;
      const Carried& frame = frames[i];
      const Vec3 p_m = frame.at_m + frame.zero * (radial_m * std::cos(angle_rad)) +
                       cross(frame.axis, frame.zero) * (radial_m * std::sin(angle_rad));
      const TubePlace place = axes->at(p_m);
      EXPECT_NEAR(place.along_m, frame.along_m, 1e-9) << i;
      EXPECT_NEAR(place.radial_m, radial_m, 1e-9) << i;
      EXPECT_NEAR(place.angle_rad, angle_rad, 1e-5) << i;
      ++asked;
    }
  }
  EXPECT_GT(asked, 150);
}

TEST(TubeAxes, capsulesInARowAreOneTube) {
  FieldGroup row{"row", {}};
  for (std::size_t i = 1; i < kBends_m.size(); ++i)
    row.parts.push_back({CapsulePart{kBends_m[i - 1], kBends_m[i], 0.004, 0.004}});
  const auto tube = TubeAxes::of(tubeOf(kBends_m, 0.004)), capsules = TubeAxes::of(row);
  ASSERT_TRUE(tube && capsules);
  for (const Vec3 p :
       {Vec3{0.01, 0.005, 0.001}, Vec3{0.047, 0.003, 0.02}, Vec3{0.051, 0.02, 0.041}, Vec3{-1, 0, 0.001}}) {
    EXPECT_EQ(tube->at(p).along_m, capsules->at(p).along_m);
    EXPECT_EQ(tube->at(p).angle_rad, capsules->at(p).angle_rad);
  }
  EXPECT_EQ(tube->at({-1, 0, 0.001}).along_m, 0) << "before its beginning";
}

TEST(TubeAxes, ofTwoTubesTheOneWhoseSurfaceIsNearest) {
  FieldGroup two = tubeOf({{0, 0, 0}, {0.1, 0, 0}}, 0.008);
  two.parts.push_back({CapsulePart{{0.1, 0.012, 0}, {0, 0.012, 0}, 0.001, 0.001}});
  const auto axes = TubeAxes::of(two);
  ASSERT_TRUE(axes);
  EXPECT_NEAR(axes->at({0.03, 0.0075, 0}).along_m, 0.03, 1e-12)
      << "in the thick one, nearer to the thin one's axis";
  EXPECT_NEAR(axes->at({0.03, 0.0125, 0}).along_m, 0.07, 1e-12) << "the thin one runs the other way";
}

TEST(TubeAxes, otherShapesHaveNone) {
  EXPECT_FALSE(TubeAxes::of({"ball", {{CapsulePart{{0, 0, 0}, {0, 0, 0}, 0.01, 0.01}}}}));
  FieldGroup mixed = tubeOf(kBends_m, 0.004);
  mixed.parts.push_back({EllipsoidPart{{0, 0, 0}, {0.01, 0.01, 0.01}}});
  EXPECT_FALSE(TubeAxes::of(mixed));
}

}  // namespace
}  // namespace needlelab::test
