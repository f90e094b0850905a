#include "client/view/model/ultrasound/ultrasound_slice.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "client/view/model/ultrasound/tissue_echoes.h"
#include "common/profile/profile.h"
#include "tests/support/view_lesson/sample_lesson.h"

namespace needlelab {
namespace {

Moment needleAt(const SceneView& scene, double depth_m, double slant_rad = 0.4) {
  Moment moment;
  const Vec3 in = -scene.focus_normal_W;
  const Vec3 side = normalized(cross(in, {1, 0, 0}));
  moment.u_W = normalized(in * std::cos(slant_rad) + side * std::sin(slant_rad));
  moment.inside = true;
  moment.p_entry_W_m = scene.focus_W_m;
  moment.p_WT_m = scene.focus_W_m + moment.u_W * depth_m;
  const Vec3 z = moment.u_W;
  moment.q_WT = 1 + z.z > 1e-9 ? normalized(Quat{-z.y, z.x, 0, 1 + z.z}) : Quat{1, 0, 0, 0};
  return moment;
}

double meanAround(const GreyImage& image, double x, double y, int half) {
  double sum = 0;
  int count = 0;
  for (int dy = -half; dy <= half; ++dy)
    for (int dx = -half; dx <= half; ++dx) {
      const int px = static_cast<int>(x) + dx, py = static_cast<int>(y) + dy;
      if (px < 0 || py < 0 || px >= image.width || py >= image.height) continue;
      sum += image.pixels[static_cast<std::size_t>(py * image.width + px)];
      ++count;
    }
  return sum / count;
}

struct Slice {
  GreyImage image;
  SlicePlane plane;
  double m_per_px = 0;
  [[nodiscard]] double x(Vec3 p) const {
    return dot(p - plane.origin_W_m, plane.right_W) / m_per_px + image.width * 0.5;
  }
  [[nodiscard]] double y(Vec3 p) const { return dot(p - plane.origin_W_m, plane.down_W) / m_per_px; }
};

Slice sliceOf(const SceneView& scene, const Moment& moment, const SliceSettings& settings = {}) {
  Slice slice;
  slice.plane = slicePlaneOf(scene, moment);
  drawSlice(scene, slice.plane, moment, settings, slice.image);
  slice.m_per_px = sliceDepth_m(scene, settings) / slice.image.height;
  return slice;
}

TEST(UltrasoundSlice, sameInSameOut) {
  const test::SampleLesson lesson = test::sampleLesson("shoulder-adult");
  const Moment moment = needleAt(*lesson.scene, 0.02);
  EXPECT_EQ(sliceOf(*lesson.scene, moment).image.pixels, sliceOf(*lesson.scene, moment).image.pixels);
}

TEST(UltrasoundSlice, theNeedleIsBrightAlongItsShaftAndEndsAtItsTip) {
  const test::SampleLesson lesson = test::sampleLesson("hip-adult");
  const Moment moment = needleAt(*lesson.scene, 0.035);
  const Slice slice = sliceOf(*lesson.scene, moment);
  for (const double share : {0.3, 0.6, 0.95}) {
    const Vec3 p = moment.p_entry_W_m + moment.u_W * (0.035 * share);
    EXPECT_GT(meanAround(slice.image, slice.x(p), slice.y(p), 0), 140) << share;
    EXPECT_GT(meanAround(slice.image, slice.x(p), slice.y(p), 0),
              1.6 * meanAround(slice.image, slice.x(p) + 12, slice.y(p) - 4, 2))
        << share;
  }
  const Vec3 beyond = moment.p_entry_W_m + moment.u_W * 0.038;
  EXPECT_LT(meanAround(slice.image, slice.x(beyond), slice.y(beyond), 1), 150);
}

TEST(UltrasoundSlice, belowBoneItIsDark) {
  const test::SampleLesson lesson = test::sampleLesson("shoulder-adult");
  const SceneView& scene = *lesson.scene;
  SliceSettings settings;
  settings.depth_m = 0.055;
  const Slice slice = sliceOf(scene, needleAt(scene, 0.005), settings);
  const double bone_m = scene.layers.back().top_m;
  const Vec3 down = -scene.focus_normal_W;
  const Vec3 top = scene.focus_W_m + down * bone_m, below = scene.focus_W_m + down * (bone_m + 0.008);
  const Vec3 muscle = scene.focus_W_m + down * 0.018;
  EXPECT_GT(meanAround(slice.image, slice.x(top) + 20, slice.y(top) + 2, 2), 70);
  EXPECT_LT(meanAround(slice.image, slice.x(below) + 20, slice.y(below), 3), 12);
  EXPECT_GT(meanAround(slice.image, slice.x(muscle) + 20, slice.y(muscle), 4), 40);
}

TEST(UltrasoundSlice, tissuesDifferAndHaveSpeckle) {
  const test::SampleLesson lesson = test::sampleLesson("lumbar-adult");
  const SceneView& scene = *lesson.scene;
  const Slice slice = sliceOf(scene, needleAt(scene, 0.002));
  const auto at = [&](double depth_m) {
    const Vec3 p = scene.focus_W_m - scene.focus_normal_W * depth_m + slice.plane.right_W * 0.02;
    return meanAround(slice.image, slice.x(p), slice.y(p), 4);
  };
  EXPECT_GT(at(0.03), 1.5 * at(0.012));  // ligament reflects more than fat
  // Within one tissue the pixels vary, and not only by rows or columns.
  double sum = 0, squares = 0;
  int count = 0;
  for (int y = 120; y < 160; ++y)
    for (int x = 200; x < 240; ++x) {
      const double v = slice.image.pixels[static_cast<std::size_t>(y * slice.image.width + x)];
      sum += v;
      squares += v * v;
      ++count;
    }
  const double mean = sum / count, deviation = std::sqrt(squares / count - mean * mean);
  EXPECT_GT(deviation / mean, 0.08);
}

TEST(UltrasoundSlice, thePlaneHoldsTheNeedleAndDoesNotFlip) {
  const test::SampleLesson lesson = test::sampleLesson("shoulder-adult");
  const SceneView& scene = *lesson.scene;
  SlicePlane before;
  bool any = false;
  int pictures_inside = 0;
  GestureReplica replica(lesson.model);
  for (const GestureSample& sample : lesson.samples) {
    const Moment& now = replica.feed(sample);
    if (sample.tick % 66 != 0) continue;
    const SlicePlane plane = slicePlaneOf(scene, now, any ? &before : nullptr);
    ASSERT_NEAR(norm(plane.right_W), 1, 1e-9);
    ASSERT_NEAR(norm(plane.down_W), 1, 1e-9);
    ASSERT_NEAR(dot(plane.right_W, plane.down_W), 0, 1e-9);
    pictures_inside = now.inside ? pictures_inside + 1 : 0;
    if (any) {
      ASSERT_GT(dot(plane.right_W, before.right_W), std::cos(0.25)) << sample.tick;
    }
    // Within a quarter turn it has found the needle: the tip lies in the plane, within the visible thickness.
    if (pictures_inside > 8) {
      const Vec3 out = cross(plane.right_W, plane.down_W);
      ASSERT_LT(std::fabs(dot(now.p_WT_m - plane.origin_W_m, out)), 0.0015) << sample.tick;
    }
    before = plane;
    any = true;
  }
}

TEST(UltrasoundSlice, anySettingsAreHeldToWhatCanBeDrawn) {
  const test::SampleLesson lesson = test::sampleLesson("finger-adult");
  SliceSettings settings;
  settings.width = -5;
  settings.height = 100000;
  settings.depth_m = 1e9;
  const Slice slice = sliceOf(*lesson.scene, needleAt(*lesson.scene, 0.004), settings);
  EXPECT_EQ(slice.image.width, 16);
  EXPECT_EQ(slice.image.height, 1024);
  EXPECT_EQ(slice.image.pixels.size(), 16u * 1024u);
}

TEST(UltrasoundSlice, aBloodVesselIsBlackWithABrightWall) {
  const test::SampleLesson lesson = test::sampleLesson("hip-adult");
  const SceneView& scene = *lesson.scene;
  // a plane across the femoral artery
  const HazardView* artery = nullptr;
  for (const HazardView& hazard : scene.hazards)
    if (hazard.name == "femoral artery") artery = &hazard;
  ASSERT_NE(artery, nullptr);
  const Vec3 middle = (artery->a_W_m + artery->b_W_m) * 0.5;
  Slice slice;
  slice.plane.down_W = -scene.focus_normal_W;
  slice.plane.right_W = normalized(cross(slice.plane.down_W, artery->b_W_m - artery->a_W_m));
  slice.plane.origin_W_m = middle + scene.focus_normal_W * depthAt(scene, middle);
  Moment away;
  away.p_WT_m = scene.focus_W_m + scene.focus_normal_W * 0.2;
  away.q_WT = {1, 0, 0, 0};
  drawSlice(scene, slice.plane, away, {}, slice.image);
  slice.m_per_px = sliceDepth_m(scene, {}) / slice.image.height;
  const double inside = meanAround(slice.image, slice.x(middle), slice.y(middle), 2);
  const Vec3 wall = middle + scene.focus_normal_W * artery->radius_m;
  EXPECT_LT(inside, 20);
  EXPECT_GT(meanAround(slice.image, slice.x(wall), slice.y(wall), 1), 3 * inside);
}

/// Muscle below the plane z = 0.
SceneView flatMuscle() {
  SceneView scene;
  scene.limb_W = PlaneLimb{{0, 0, 0}, {0, 0, 1}};
  scene.layers.resize(1);
  scene.layers[0].kind = pb::Volume::Structure::MUSCLE;
  scene.layers[0].bottom_m = 0.2;
  scene.needle.length_m = 0.05;
  scene.focus_normal_W = {0, 0, 1};
  return scene;
}

/// A needle above the skin that points down.
Moment needleAway() {
  Moment moment;
  moment.p_WT_m = {0.01, 0.02, 0.2};
  moment.q_WT = {1, 0, 0, 0};
  return moment;
}

TEST(UltrasoundSlice, reachesAThirdBeyondTheDeepestTargetWithinItsLimits) {
  struct Row {
    const char* name;
    std::vector<std::pair<double, double>> targets;  ///< depth and radius, m
    double wanted_m, expected_m;
  };
  const std::vector<Row> rows = {{"one target", {{0.04, 0.004}}, 0, 1.33 * 0.044},
                                 {"the deeper of two", {{0.06, 0.002}, {0.03, 0.01}}, 0, 1.33 * 0.062},
                                 {"a shallow one", {{0.005, 0.001}}, 0, 0.02},
                                 {"a very deep one", {{0.3, 0.01}}, 0, 0.12},
                                 {"none: by the needle", {}, 0, 1.33 * 0.6 * 0.05},
                                 {"one outside the limb", {{-0.02, 0.003}}, 0, 1.33 * 0.6 * 0.05},
                                 {"as told", {{0.04, 0.004}}, 0.03, 0.03},
                                 {"told too little", {{0.04, 0.004}}, 1e-6, 0.005},
                                 {"told too much", {{0.04, 0.004}}, 9, 0.5}};
  for (const Row& row : rows) {
    SceneView scene = flatMuscle();
    for (const auto& [depth_m, radius_m] : row.targets) {
      const Vec3 middle{0, 0, -depth_m};
      scene.targets.push_back(
          {"t", middle, radius_m, middle, {0, 0, 1}, depth_m - radius_m, depth_m + radius_m});
    }
    SliceSettings settings;
    settings.depth_m = row.wanted_m;
    EXPECT_NEAR(sliceDepth_m(scene, settings), row.expected_m, 1e-12) << row.name;
  }
}

TEST(UltrasoundSlice, beforeTheEntryTheProbeIsBelowTheTip) {
  const SlicePlane plane = slicePlaneOf(flatMuscle(), needleAway());
  EXPECT_NEAR(norm(plane.origin_W_m - Vec3{0.01, 0.02, 0}), 0, 1e-12);
  EXPECT_NEAR(norm(plane.down_W - Vec3{0, 0, -1}), 0, 1e-12);
  EXPECT_NEAR(norm(plane.right_W - Vec3{1, 0, 0}), 0, 1e-12) << "a needle along the normal has no side";
}

TEST(UltrasoundSlice, theProbeTurnsToTheNeedleInFifthRadianSteps) {
  const SceneView scene = flatMuscle();
  Moment moment;
  moment.inside = true;
  moment.u_W = normalized(Vec3{0, 0.5, -1});
  moment.p_WT_m = moment.u_W * 0.02;
  SlicePlane plane{{0, 0, 0}, {1, 0, 0}, {0, 0, -1}};
  // from x to y
  for (int picture = 1; picture <= 9; ++picture) {
    plane = slicePlaneOf(scene, moment, &plane);
    const double turned_rad = std::min(0.2 * picture, std::acos(0.0));
    EXPECT_NEAR(plane.right_W.x, std::cos(turned_rad), 1e-9) << picture;
    EXPECT_NEAR(plane.right_W.y, std::sin(turned_rad), 1e-9) << picture;
    EXPECT_NEAR(norm(plane.origin_W_m), 0, 1e-12) << "at the entry";
  }
}

TEST(UltrasoundSlice, aNeedleOutsideThePlaneIsNotShown) {
  const test::SampleLesson lesson = test::sampleLesson("hip-adult");
  const Moment needle = needleAt(*lesson.scene, 0.035);
  Moment away;
  away.p_WT_m = lesson.scene->focus_W_m + lesson.scene->focus_normal_W * 0.3;
  away.q_WT = needleAt(*lesson.scene, 0.01, 0).q_WT;
  for (const double aside_m : {0.0, 0.008, -0.008}) {
    SlicePlane plane = slicePlaneOf(*lesson.scene, needle);
    plane.origin_W_m += cross(plane.right_W, plane.down_W) * aside_m;
    GreyImage with, without;
    drawSlice(*lesson.scene, plane, needle, {}, with);
    drawSlice(*lesson.scene, plane, away, {}, without);
    EXPECT_EQ(with.pixels != without.pixels, aside_m == 0) << aside_m;
  }
}

TEST(UltrasoundSlice, aHazardOffThePlaneFadesWithItsDistance) {
  // a vessel's ball in muscle: the closer to the plane, the darker
  constexpr double kRadius_m = 0.004, kDown_m = 0.02;
  SliceSettings settings;
  settings.depth_m = 0.04;
  Slice slice;
  slice.plane = {{0, 0, 0}, {1, 0, 0}, {0, 0, -1}};
  slice.m_per_px = settings.depth_m / settings.height;
  const auto greyAt = [&](std::optional<double> off_m) {
    SceneView scene = flatMuscle();
    if (off_m) {
      const Vec3 middle{0, kRadius_m + *off_m, -kDown_m};
      scene.hazards.push_back({"artery", pb::Hazard::VESSEL, middle, middle, kRadius_m});
    }
    drawSlice(scene, slice.plane, needleAway(), settings, slice.image);
    return meanAround(slice.image, slice.x({0, 0, -kDown_m}), slice.y({0, 0, -kDown_m}), 10);
  };
  const double muscle = greyAt({}), near = greyAt(0.0009);
  EXPECT_LT(near, 0.7 * muscle);
  for (const double off_m : {0.005, 0.009, 0.017}) {
    // brightness is echo times grain and fading: the vessel removes light in proportion to its opacity
    const double share = (muscle - greyAt(off_m)) / (muscle - near);
    EXPECT_NEAR(share, offPlaneOpacity(off_m), 0.05) << off_m;
  }
  EXPECT_EQ(greyAt(0.08), muscle) << "too faint to be drawn";
}

TEST(UltrasoundSlice, labelsSayWhereAHazardIs) {
  SceneView scene = flatMuscle();
  const SlicePlane plane{{0, 0, 0}, {1, 0, 0}, {0, 0, -1}};
  // an eye on the right × down side looks along +y
  const auto add = [&](const char* name, Vec3 a, Vec3 b) {
    scene.hazards.push_back({name, pb::Hazard::NERVE, a, b, 0.002});
  };
  add("in it", {0.004, 0.001, -0.02}, {0.004, 0.001, -0.02});
  add("beyond", {-0.004, 0.01, -0.01}, {-0.004, 0.01, -0.01});
  add("before", {0, -0.012, -0.015}, {0, -0.012, -0.015});
  add("through", {-0.01, -0.03, -0.02}, {0.01, 0.03, -0.02});
  add("too far to be drawn", {0, 0.08, -0.015}, {0, 0.08, -0.015});
  add("beside the picture", {0.05, 0, -0.015}, {0.05, 0, -0.015});
  add("below the picture", {0, 0, -0.06}, {0, 0, -0.06});
  const std::vector<SliceLabel> labels = sliceLabels(scene, plane, 0.02, 0.04);
  ASSERT_EQ(labels.size(), 4u);
  EXPECT_EQ(labels[0].text, "in it");
  EXPECT_EQ(labels[1].text, "beyond, 8 mm behind");
  EXPECT_EQ(labels[2].text, "before, 10 mm in front");
  EXPECT_EQ(labels[3].text, "through");
  EXPECT_NEAR(labels[1].right_m, -0.004, 1e-12);
  EXPECT_NEAR(labels[1].down_m, 0.01, 1e-12);
  EXPECT_NEAR(labels[1].opacity, offPlaneOpacity(0.008), 1e-12);
  EXPECT_NEAR(labels[3].right_m, 0, 1e-12) << "where the plane cuts it";
}

TEST(UltrasoundSlice, aHazardAppearsAtItsCrossSection) {
  struct Row {
    double right_m, depth_m, aside_m;  ///< of the ball's centre, in the plane's frame
  };
  constexpr double kRadius_m = 0.003;
  SliceSettings settings;
  settings.depth_m = 0.04;
  for (const Row& row :
       {Row{0.006, 0.015, 0}, Row{-0.008, 0.025, 0}, Row{0.005, 0.02, 0.002}, Row{-0.004, 0.018, -0.002}}) {
    SceneView scene = flatMuscle();
    Slice slice;
    slice.plane = {{0, 0, 0}, {1, 0, 0}, {0, 0, -1}};
    const Vec3 middle{row.right_m, row.aside_m, -row.depth_m};
    scene.hazards.push_back({"artery", pb::Hazard::VESSEL, middle, middle, kRadius_m});
    drawSlice(scene, slice.plane, needleAway(), settings, slice.image);
    slice.m_per_px = settings.depth_m / slice.image.height;
    // a plane at that distance from the centre cuts the ball in a circle
    const double circle_m = std::sqrt(kRadius_m * kRadius_m - row.aside_m * row.aside_m);
    double inside = 0, around = 0, mirrored = 0;
    int n_inside = 0, n_around = 0, n_mirrored = 0;
    for (int y = 0; y < slice.image.height; ++y)
      for (int x = 0; x < slice.image.width; ++x) {
        const double right_m = (x + 0.5 - slice.image.width / 2.0) * slice.m_per_px,
                     down_m = (y + 0.5) * slice.m_per_px - row.depth_m;
        const double grey = slice.image.pixels[static_cast<std::size_t>(y * slice.image.width + x)];
        const double away_m = std::hypot(right_m - row.right_m, down_m);
        if (away_m < 0.6 * circle_m) inside += grey, ++n_inside;
        if (away_m > circle_m + 0.0012 && away_m < circle_m + 0.0025) around += grey, ++n_around;
        if (std::hypot(right_m + row.right_m, down_m) < 0.6 * circle_m) mirrored += grey, ++n_mirrored;
      }
    ASSERT_TRUE(n_inside > 0 && n_around > 0 && n_mirrored > 0);
    EXPECT_LT(inside / n_inside, 20) << row.right_m;
    EXPECT_GT(around / n_around, 40) << row.right_m;
    EXPECT_GT(mirrored / n_mirrored, 40) << "left and right are not exchanged";
  }
}

/// A patient of db/samples/volumes.
SceneView patientView(const char* name) {
  const auto profile =
      loadProfile(std::filesystem::path(NEEDLELAB_SAMPLES) / "volumes" / (std::string(name) + ".json"));
  EXPECT_TRUE(profile.ok());
  return *sceneViewOf(*profile);
}

TEST(UltrasoundSlice, theUlnarNerveLooksLikeTheMedianOneThoughNoHazardNamesIt) {
  const SceneView wrist = patientView("wrist-median");
  const auto named = [&](const char* name) {
    return *std::ranges::find(wrist.layers, name, &LayerView::name);
  };
  const LayerView ulnar = named("ulnar nerve"), median = named("median nerve");
  EXPECT_EQ(ulnar.colour, median.colour);
  EXPECT_EQ(echoOf(ulnar.kind).mean, echoOf(pb::Hazard::NERVE).mean);
  EXPECT_GT(echoOf(ulnar.kind).mean, echoOf(named("radial artery").kind).mean + 0.3F);
  EXPECT_TRUE(ulnar.tubes) << "its fibres run along it";
}

// The field itself says which structure is at a pixel; means over many pixels of it tell tissues apart.
TEST(UltrasoundSlice, ofABodyShowsTheStructuresWhereTheFieldHasThem) {
  std::map<pb::Layer::Tissue, std::pair<double, int>> light;
  int gel = 0, gel_dark = 0, behind_bone = 0, behind_bone_dark = 0;
  for (const char* const name : {"shoulder-median", "knee-median", "wrist-median", "lumbar-median"}) {
    const SceneView scene = patientView(name);
    Moment moment = needleAt(scene, 0.01);
    moment.p_WT_m = moment.p_WT_m + Vec3{0, 0, 1};  // the needle is not in the picture
    const Slice slice = sliceOf(scene, moment);
    for (int x = 0; x < slice.image.width; x += 2) {
      bool shaded = false;
      for (int y = 4; y < slice.image.height; y += 2) {
        const Vec3 p = slice.plane.origin_W_m +
                       slice.plane.right_W * ((x + 0.5 - 0.5 * slice.image.width) * slice.m_per_px) +
                       slice.plane.down_W * ((y + 0.5) * slice.m_per_px);
        const int at = layerAt(scene, p);
        const int grey = slice.image.pixels[static_cast<std::size_t>(y * slice.image.width + x)];
        if (at < 0) {
          ++gel;
          gel_dark += grey < 20;
          continue;
        }
        const pb::Layer::Tissue tissue =
            structureKind(scene.layers[static_cast<std::size_t>(at)].kind).tissue;
        if (shaded && tissue != pb::Layer::BONE) {
          ++behind_bone;
          behind_bone_dark += grey < 25;
          continue;
        }
        if (tissue == pb::Layer::BONE && depthAt(scene, p) > 0.004) shaded = true;
        auto& [sum, count] = light[tissue];
        sum += grey;
        ++count;
      }
    }
  }
  const auto mean = [&](pb::Layer::Tissue tissue) { return light[tissue].first / light[tissue].second; };
  ASSERT_GT(light[pb::Layer::FAT].second, 500);
  ASSERT_GT(light[pb::Layer::MUSCLE].second, 300);
  ASSERT_GT(light[pb::Layer::SKIN].second, 50);
  EXPECT_GT(mean(pb::Layer::SKIN), mean(pb::Layer::MUSCLE) + 30);
  EXPECT_GT(mean(pb::Layer::MUSCLE), mean(pb::Layer::FAT) + 8);
  EXPECT_EQ(gel_dark, gel);
  EXPECT_GT(behind_bone, 100);
  EXPECT_GT(behind_bone_dark, 0.9 * behind_bone) << "bone stops the sound";
}

}  // namespace
}  // namespace needlelab
