/// Surface nets: against balls and capsules by formula, against points drawn in a field.
#include "common/anatomy/surface_nets.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <numbers>
#include <utility>

#include "tests/support/anatomy/fields.h"

namespace needlelab::test {
namespace {

constexpr double kPi = std::numbers::pi;

Field oneTissue(FieldPart part) {
  FieldSpec spec;
  spec.groups = {{"skin", {std::move(part)}}};
  spec.structures = {structure("tissue")};
  spec.skin = "skin";
  spec.rest = "tissue";
  return fieldOf(spec);
}

/// A ball of 30 mm with a core of 25 mm.
Field shellAndCore() {
  FieldSpec spec;
  spec.groups = {{"skin", {ball({}, 30)}}};
  spec.structures = {structure("shell"), structure("core")};
  spec.rules = {rule("skin", -5, 0, "shell")};
  spec.skin = "skin";
  spec.rest = "core";
  return fieldOf(spec);
}

double volumeOf(const SurfaceMesh& mesh) {  // divergence theorem
  double sixfold_m3 = 0;
  for (const auto& [a, b, c] : mesh.triangles)
    sixfold_m3 += dot(mesh.vertices[a].p_m, cross(mesh.vertices[b].p_m, mesh.vertices[c].p_m));
  return sixfold_m3 / 6;
}

/// Edges that do not have one triangle on each side, as directed edges without their opposite.
std::vector<std::pair<std::uint32_t, std::uint32_t>> openEdges(const SurfaceMesh& mesh) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  for (const auto& triangle : mesh.triangles)
    for (std::size_t i = 0; i < 3; ++i) {
      const std::uint32_t a = triangle[i], b = triangle[(i + 1) % 3];
      ++edges[{a, b}];
      --edges[{b, a}];
    }
  std::vector<std::pair<std::uint32_t, std::uint32_t>> open;
  for (const auto& [edge, count] : edges)
    if (count > 0) open.push_back(edge);
  return open;
}

TEST(SurfaceNets, ofABallAreOnTheBallAndTheirTrianglesNearlySo) {
  const Field field = oneTissue(ball(mm(3, -2, 1), 20));
  for (const double cell_mm : {4.0, 2.0, 1.0}) {
    const double h = cell_mm * 1e-3, radius_m = 0.02;
    const SurfaceMesh mesh = surfaceNet(field, kWholeBody, {.cell_m = h});
    ASSERT_FALSE(mesh.triangles.empty());
    for (const SurfaceMesh::Vertex& vertex : mesh.vertices) {
      const Vec3 out = vertex.p_m - mm(3, -2, 1);
      EXPECT_NEAR(norm(out), radius_m, 2e-3 * h * h / radius_m) << "one Newton step";
      EXPECT_GT(dot(vertex.normal, out) / norm(out), 1 - 1e-5);
    }
    // the middle of a triangle in a ball of R is √(R² − (a² + b² + c²)/9) from its centre; edges are at most
    // 2 h
    for (const auto& [a, b, c] : mesh.triangles) {
      const Vec3 middle = (mesh.vertices[a].p_m + mesh.vertices[b].p_m + mesh.vertices[c].p_m) / 3;
      const double off_m = norm(middle - mm(3, -2, 1)) - radius_m;
      EXPECT_LT(off_m, 1e-9);
      EXPECT_GT(off_m, -2 * h * h / (3 * radius_m));
    }
  }
}

TEST(SurfaceNets, areClosedAndHaveTheVolumeOfTheFormula) {
  const double cell_m = 1e-3;
  struct Case {
    Field field;
    double volume_m3, area_m2, radius_m;
  };
  const double r = 8e-3, length = 30e-3;
  for (const Case& one : {Case{oneTissue(ball({}, 8)), 4 * kPi / 3 * r * r * r, 4 * kPi * r * r, r},
                          Case{oneTissue(capsule(mm(-9, 3, 2), mm(-9 + 10, 3 + 20, 2 + 20), 8, 8)),
                               kPi * r * r * (length + 4 * r / 3), 2 * kPi * r * (length + 2 * r), r}}) {
    const SurfaceMesh mesh = surfaceNet(one.field, kWholeBody, {.cell_m = cell_m});
    EXPECT_TRUE(openEdges(mesh).empty());
    EXPECT_LT(volumeOf(mesh), one.volume_m3);
    EXPECT_GT(volumeOf(mesh), one.volume_m3 - one.area_m2 * cell_m * cell_m / (4 * one.radius_m));
    EXPECT_NEAR(areaOf(mesh), one.area_m2, 0.01 * one.area_m2);
  }
}

TEST(SurfaceNets, ofAForearmsStructuresAreClosedAndHaveTheirVolume) {
  const Field field = fieldOf(forearm());
  Random random(11);
  const FieldBox box = field.boxAround(kWholeBody);
  const Vec3 size_m = box.high_m - box.low_m;
  std::vector<int> drawn(field.structures().size(), 0);
  constexpr int kDraws = 400'000;
  int inside = 0;
  for (int i = 0; i < kDraws; ++i) {
    const StructureIndex here = field.at(randomPoint(random, box.low_m * 1e3, box.high_m * 1e3)).structure;
    if (here == kOutside) continue;
    ++drawn[here];
    ++inside;
  }
  const double per_draw_m3 = size_m.x * size_m.y * size_m.z / kDraws;
  const auto expectVolume = [&](const char* name, StructureMask mask, int points) {
    const SurfaceMesh mesh = surfaceNet(field, mask, {.cell_m = 0.8e-3});
    EXPECT_TRUE(openEdges(mesh).empty()) << name;
    // three standard deviations of the count, and a twentieth of a cell's corner cutting
    const double wanted_m3 = points * per_draw_m3;
    EXPECT_NEAR(volumeOf(mesh), wanted_m3, 3 * std::sqrt(points) * per_draw_m3 + 0.05 * 0.8e-3 * areaOf(mesh))
        << name;
  };
  expectVolume("skin", kWholeBody, inside);
  for (std::size_t i = 0; i < field.structures().size(); ++i) {
    const std::string& id = field.structures()[i].id;
    if (id != "bone" && id != "nerve" && id != "artery") continue;
    expectVolume(id.c_str(), maskOf(static_cast<StructureIndex>(i)), drawn[i]);
  }
}

TEST(SurfaceNets, ofSeveralStructuresHaveNoBoundaryBetweenThem) {
  const Field field = shellAndCore();
  const auto volume = [&](StructureMask mask) { return volumeOf(surfaceNet(field, mask, {.cell_m = 1e-3})); };
  const double whole_m3 = 4 * kPi / 3 * 27e-6, core_m3 = 4 * kPi / 3 * 15.625e-6;
  EXPECT_NEAR(volume(maskOf(0) | maskOf(1)), whole_m3, 0.003 * whole_m3);
  EXPECT_NEAR(volume(maskOf(1)), core_m3, 0.003 * core_m3);
  EXPECT_NEAR(volume(maskOf(0)), whole_m3 - core_m3, 0.006 * whole_m3) << "a hollow shell";
}

TEST(SurfaceNets, endOpenOnlyWhereTheirBoxCutsThem) {
  const Field field = oneTissue(halfSpace({}, {0, 0, 1}));
  const double cell_m = 2e-3, half_m = 0.02;
  const SurfaceMesh mesh =
      surfaceNet(field, kWholeBody,
                 {.cell_m = cell_m, .within = {{-half_m, -half_m, -half_m}, {half_m, half_m, half_m}}});
  EXPECT_NEAR(areaOf(mesh), 4 * half_m * half_m, 4 * half_m * cell_m * 2);
  EXPECT_FALSE(openEdges(mesh).empty());
  for (const auto& [a, b] : openEdges(mesh))
    for (const std::uint32_t end : {a, b}) {
      const Vec3 p = mesh.vertices[end].p_m;
      EXPECT_GT(std::max(std::fabs(p.x), std::fabs(p.y)), half_m - cell_m);
    }
}

TEST(SurfaceNets, haveAboutAsManyTrianglesAsTheCellWasChosenFor) {
  const Field field = oneTissue(ball({}, 20));
  const double area_m2 = 4 * kPi * 4e-4;
  for (const std::size_t wanted : {std::size_t{2'000}, std::size_t{20'000}}) {
    const SurfaceMesh mesh = surfaceNet(field, kWholeBody, {.cell_m = cellFor_m(area_m2, wanted)});
    EXPECT_NEAR(static_cast<double>(mesh.triangles.size()), static_cast<double>(wanted),
                0.08 * static_cast<double>(wanted));
  }
}

TEST(SurfaceNets, growTheirCellsWhereTheirMemoryWouldNotHoldThem) {
  // 40 × 40 × 20 mm under the top of a large ball, 32 million cells: their area grows by (32/16.8)^(2/3)
  const Vec3 half = mm(20, 20, 20), top = mm(0, 0, 400);
  const SurfaceMesh mesh =
      surfaceNet(oneTissue(ball({}, 400)), kWholeBody, {.cell_m = 1e-4, .within = {top - half, top + half}});
  const double cells = 32e6 / static_cast<double>(kMaxNetCells);
  EXPECT_NEAR(static_cast<double>(mesh.vertices.size()), 160'000 / std::cbrt(cells * cells), 6'000);
}

TEST(FieldInBall, hasTheSameBitsAsTheFieldThere) {
  const Field field = fieldOf(forearm());
  Random random(3);
  for (int i = 0; i < 2'000; ++i) {
    const Vec3 center = randomPoint(random, {-60, -35, -45}, {60, 35, 5});
    const Field::InBall near = field.inBall(center, 4e-3);
    const Vec3 p = center + normalized(randomPoint(random, {-1, -1, -1}, {1, 1, 1})) * random.in(0, 4e-3);
    ASSERT_EQ(near.at(p).structure, field.at(p).structure);
    // a surface in the ball is at the same place
    const double d = field.structuresDistance(maskOf(8), p);
    if (std::fabs(d) < 1e-3) {
      ASSERT_EQ(near.structuresDistance(maskOf(8), p), d);
    }
    // a ball made of a ball has its values, also far from any surface
    const Vec3 q = p + normalized(randomPoint(random, {-1, -1, -1}, {1, 1, 1})) * 1e-4;
    ASSERT_EQ(near.inBall(p, 1.01e-4).structuresDistance(maskOf(8), q),
              near.structuresDistance(maskOf(8), q));
  }
}

TEST(FieldBox, holdsEveryPointOfItsStructures) {
  const Field field = fieldOf(forearm());
  Random random(5);
  const FieldBox body = field.boxAround(kWholeBody);
  for (int i = 0; i < 50'000; ++i) {
    const Vec3 p = randomPoint(random, {-90, -60, -60}, {90, 60, 30});
    const StructureIndex here = field.at(p).structure;
    if (here == kOutside) continue;
    for (const FieldBox& box : {body, field.boxAround(maskOf(here))})
      ASSERT_FALSE(common(box, {p - mm(1e-6, 1e-6, 1e-6), p + mm(1e-6, 1e-6, 1e-6)}).empty()) << i;
  }
}

}  // namespace
}  // namespace needlelab::test
