/// The patients in db/samples/volumes, by the engine's own march: canonical files, the layers on the planned
/// path, what wrong paths meet.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/anatomy/march.h"
#include "common/base/files/files.h"
#include "common/haptics/body/body_engine.h"
#include "common/haptics/surface.h"
#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"
#include "common/profile/volume.h"
#include "common/profile/warnings.h"
#include "tests/support/random.h"

namespace needlelab {
namespace {

const std::filesystem::path kVolumes = std::filesystem::path(NEEDLELAB_SAMPLES) / "volumes";

/// A structure's id, and how far along the needle it begins.
using Layers = std::vector<std::pair<std::string, double>>;

Layers layersOf(const nlohmann::json& list) {
  Layers layers;
  for (const auto& layer : list)
    layers.emplace_back(layer[0].get<std::string>(), 1e-3 * layer[1].get<double>());
  return layers;
}

Vec3 pointOf(const nlohmann::json& point) {
  return {point["x"].get<double>(), point["y"].get<double>(), point["z"].get<double>()};
}

struct Patient {
  pb::Profile profile;
  Field field;
  nlohmann::json paths;

  [[nodiscard]] std::string id(StructureIndex structure) const {
    return structure == kOutside ? "outside" : profile.volume().structures(structure).id();
  }
  [[nodiscard]] std::string at(Vec3 p_m) const { return id(field.at(p_m).structure); }

  [[nodiscard]] Layers through(Vec3 point_m, double beyond_m) const {
    const Vec3 axis = normalized(point_m);
    const std::optional<double> entry_m = findEntry(field, axis * -1e-3, axis, 2e-3);
    if (!entry_m) return {};
    const double diameter_m = needleOf(profile.needle()).outer_diameter_m;
    const LayerStack stack = march(field, axis * (*entry_m - 1e-3), axis,
                                   {.reach_m = norm(point_m) + beyond_m, .min_layer_m = diameter_m / 2});
    Layers layers;
    for (std::size_t i = 0; i < stack.count; ++i) {
      const LayerStack::Layer& layer = stack.layers[i];
      layers.emplace_back(id(layer.structure), layer.top_m + *entry_m - 1e-3);
    }
    return layers;
  }
};

Patient patientOf(const nlohmann::json& paths) {
  const auto profile = loadProfile(kVolumes / (paths["profile"].get<std::string>() + ".json"));
  EXPECT_TRUE(profile.ok()) << profile.error().message;
  auto field = fieldOf(profile->volume());
  EXPECT_TRUE(field.ok()) << field.error().message;
  return {*profile, std::move(field).value(), paths};
}

std::vector<Patient> patients() {
  std::vector<Patient> all;
  const auto text = readWholeFile(NEEDLELAB_PATIENT_PATHS);
  EXPECT_TRUE(text.ok());
  const nlohmann::json tree = nlohmann::json::parse(*text);
  for (const auto& paths : tree["paths"]) all.push_back(patientOf(paths));
  EXPECT_EQ(all.size(), 12u);
  return all;
}

TEST(VolumePatients, areCanonicalAndMeetTheNeedleAtTheOrigin) {
  for (const Patient& patient : patients()) {
    const std::string id = patient.profile.id();
    SCOPED_TRACE(id);
    EXPECT_EQ(profileJson(patient.profile), *readWholeFile(kVolumes / (id + ".json")));
    EXPECT_EQ(patient.at({0, 0, 1e-5}), "outside");
    EXPECT_EQ(patient.at({0, 0, -1e-5}), "skin");
    EXPECT_EQ(std::ranges::count(patient.profile.effects(), pb::Profile::BONE), 1);
  }
}

TEST(VolumePatients, theMarchFindsTheGeneratorsLayers) {
  for (const Patient& patient : patients()) {
    SCOPED_TRACE(patient.profile.id());
    const Layers written = layersOf(patient.paths["planned"]);
    const Layers found = patient.through(pointOf(patient.paths["target_m"]), 8e-3);
    ASSERT_EQ(found.size(), written.size());
    for (std::size_t i = 0; i < found.size(); ++i) {
      EXPECT_EQ(found[i].first, written[i].first);
      EXPECT_NEAR(found[i].second, written[i].second, 5e-6) << found[i].first;
    }
  }
}

TEST(VolumePatients, thePlannedPathReachesTheTargetClearOfHazards) {
  for (const Patient& patient : patients()) {
    SCOPED_TRACE(patient.profile.id());
    const std::string goal = patient.paths["target"];
    const Vec3 target_m = pointOf(patient.paths["target_m"]);
    for (const auto& [id, top_m] : patient.through(target_m, 0)) {
      for (const auto& hazard : patient.paths["hazards"]) EXPECT_NE(id, hazard.get<std::string>());
      for (const auto& structure : patient.profile.volume().structures())
        EXPECT_FALSE(structure.id() == id && structure.layer().tissue() == pb::Layer::BONE) << id;
    }
    const pb::Target& target = patient.profile.targets(0);
    EXPECT_EQ(target.structure(), goal);
    EXPECT_EQ(norm(vectorOf(target.center_m()) - target_m), 0) << "where to aim";
    EXPECT_EQ(patient.at(target_m), goal);
  }
}

TEST(VolumePatients, theCourseHasEachOfThemAndPlansTheMedianOnes) {
  const auto course = loadCurriculum(kVolumes / "bodies-curriculum.json");
  ASSERT_TRUE(course.ok()) << course.error().message;
  for (const Patient& patient : patients()) {
    const std::string id = patient.profile.id();
    SCOPED_TRACE(id);
    const auto& all = course->exercises();
    const auto exercise = std::ranges::find(all, id, [](const auto& one) { return one.profile_id(); });
    ASSERT_NE(exercise, all.end());
    for (const char* const fault : {"hazards_touched", "bone_contacts"})
      EXPECT_TRUE(std::ranges::any_of(exercise->requirements(), [&](const auto& asked) {
        return asked.measure() == fault && asked.has_max() && asked.max() <= 1;
      })) << fault;
    EXPECT_EQ(exercise->has_plan(), id.ends_with("-median"));
    if (!exercise->has_plan()) continue;
    const Vec3 way = normalized(pointOf(patient.paths["target_m"]));
    EXPECT_LT(norm(vectorOf(exercise->plan().direction()) - way), 1e-4) << "straight to where to aim";
  }
}

/// A needle along the planned path to where to aim, 20 mm/s, and what the engine reports of it.
struct Insertion {
  std::vector<std::string> layers;
  double peak_N = 0, bone_N = 0;
  std::uint64_t hash = 0;
};
Insertion inserted(const Patient& patient) {
  Insertion insertion;
  const auto scene = sceneSpecOf(patient.profile);
  EXPECT_TRUE(scene.ok()) << scene.error().message;
  const auto model = std::make_unique<SceneModel>(*compile(*scene, 1000));
  SceneEngine engine(*model);
  const Vec3 aim_m = pointOf(patient.paths["target_m"]), axis = normalized(aim_m);
  const Vec3 start_m = axis * -0.005;
  // half a turn points the needle down; then from straight down to the axis
  const Vec3 down{0, 0, -1}, turn = cross(down, axis);
  const Quat q = normalized(Quat{turn.x, turn.y, turn.z, 1 + dot(down, axis)}) * Quat{1, 0, 0, 0};
  StepReport report;
  for (int k = -100; k * 2e-5 < 0.005 + norm(aim_m); ++k) {
    engine.step({start_m + axis * (2e-5 * std::max(k, 0)), q}, report);
    insertion.peak_N = std::max(insertion.peak_N, norm(report.wrench_W.force_N));
    insertion.bone_N = std::max(insertion.bone_N, report.stage_N[stageOf(Effect::kBone)]);
    if (report.layer < 0) continue;
    const std::string id = patient.id(static_cast<StructureIndex>(report.layer));
    if (insertion.layers.empty() || insertion.layers.back() != id) insertion.layers.push_back(id);
  }
  insertion.hash = hashOf(engine.state());
  return insertion;
}

TEST(VolumePatients, aNeedleOnThePlannedPathFeelsTheirLayersTwiceAlike) {
  for (const Patient& patient : patients()) {
    SCOPED_TRACE(patient.profile.id());
    std::vector<std::string> expected;
    for (const auto& [id, top_m] : layersOf(patient.paths["expected"])) {
      expected.push_back(id);
      if (id == patient.paths["target"]) break;
    }
    const Insertion once = inserted(patient), again = inserted(patient);
    EXPECT_EQ(once.layers, expected);
    EXPECT_EQ(once.bone_N, 0);
    EXPECT_GT(once.peak_N, 0.3);
    EXPECT_LT(once.peak_N, 8);
    EXPECT_EQ(once.hash, again.hash);
    EXPECT_EQ(once.peak_N, again.peak_N);
  }
}

// A capped tip comes down at random places, slides to and fro up to 12 mm deep, over edges of bone and
// valleys of skin, and lifts: no tick steps by more than FORCE_MODEL.md says, and the hand gets back no more
// than it gave.
TEST(VolumePatients, aCappedTipThatSlidesOverThemIsSmoothAndPassive) {
  constexpr double kLoop_hz = 1000, kFall_m = 0.020 / kLoop_hz;
  constexpr int kSlideTicks = 4000, kSlides = 4;
  double most_N = 0, soft_N = 0;
  for (const Patient& patient : patients()) {
    SCOPED_TRACE(patient.profile.id());
    SceneSpec scene = *sceneSpecOf(patient.profile);
    scene.max_force_N = 50;
    const auto model = std::make_unique<SceneModel>(*compile(scene, kLoop_hz));
    const pb::Palpation& numbers = patient.profile.palpation();
    const double ks = numbers.skin_stiffness_n_per_m(), kp = numbers.bone_stiffness_n_per_m(),
                 mu = numbers.friction_coefficient();
    soft_N = std::max(soft_N, ks * 0.015 * std::sqrt(1 + mu * mu));
    test::Random random(7);
    for (int slide = 0; slide < kSlides; ++slide) {
      SceneEngine engine(*model);
      engine.wantCap(true);
      const Vec3 over =
          nearestSkin(scene.limb, {random.in(-0.04, 0.04), random.in(-0.04, 0.04), 0}, {0, 0, -1});
      const Vec3 out = surfaceNormal(scene.limb, over, {0, 0, -1});
      const Vec3 side = normalized(cross(out, std::fabs(out.x) < 0.9 ? Vec3{1, 0, 0} : Vec3{0, 1, 0})),
                 other = cross(out, side);
      const double phase[] = {random.in(0, 6), random.in(0, 6), random.in(0, 6)};
      Vec3 tip_before, force_before;
      double given_J = 0;
      for (int k = 0; k < kSlideTicks; ++k) {
        const double t_s = k / kLoop_hz, share = std::sin(std::numbers::pi * k / (kSlideTicks - 1));
        const double deep_m = 0.006 + 0.006 * std::sin(3 * t_s + phase[2]);
        const Vec3 tip = over + side * (0.02 * share * std::sin(2.5 * t_s + phase[0])) +
                         other * (0.02 * share * std::sin(1.7 * t_s + phase[1])) +
                         out * (0.012 * (1 - share) - share * deep_m);
        StepReport report;
        engine.step({tip, {1, 0, 0, 0}}, report);
        const Vec3 force = report.wrench_W.force_N;
        if (k > 0) {
          const double way_m = norm(tip - tip_before);
          ASSERT_LE(norm(force - force_before), ks * (std::sqrt(2 + mu * mu) * way_m + kFall_m) +
                                                    kp * (std::sqrt(2.0) * way_m + kFall_m) + 1e-6)
              << slide << ", tick " << k;
          given_J -= 0.5 * dot(force + force_before, tip - tip_before);
          ASSERT_GT(given_J, -2e-6) << slide << ", tick " << k;
        }
        most_N = std::max(most_N, norm(force));
        tip_before = tip;
        force_before = force;
      }
    }
  }
  EXPECT_GT(most_N, 3 * soft_N) << "bone is felt";
}

// Needles at random places and angles, 20 mm/s: where one begins to rest on bone, the field has bone.
TEST(VolumePatients, contactWithBoneBeginsOnBone) {
  int contacts = 0;
  for (const Patient& patient : patients()) {
    SCOPED_TRACE(patient.profile.id());
    const SceneSpec scene = *sceneSpecOf(patient.profile);
    const auto model = std::make_unique<SceneModel>(*compile(scene, 1000));
    StructureMask bones = 0;
    for (std::size_t i = 0; i < scene.layers.size(); ++i)
      if (scene.layers[i].is_bone) bones |= StructureMask{1} << i;
    test::Random random(11);
    for (int needle = 0; needle < 15; ++needle) {
      const Vec3 entry =
          nearestSkin(scene.limb, {random.in(-0.04, 0.04), random.in(-0.04, 0.04), 0}, {0, 0, -1});
      const Vec3 beside{random.in(-0.015, 0.015), random.in(-0.015, 0.015), random.in(-0.015, 0.015)};
      const Vec3 axis = normalized(beside - surfaceNormal(scene.limb, entry, {0, 0, -1}) * 0.03);
      const Vec3 down{0, 0, -1}, turn = cross(down, axis);
      const Quat q = normalized(Quat{turn.x, turn.y, turn.z, 1 + dot(down, axis)}) * Quat{1, 0, 0, 0};
      SceneEngine engine(*model);
      StepReport report;
      bool touched = false;
      for (int k = -100; k < 2200; ++k) {
        engine.step({entry + axis * (2e-5 * std::max(k, 0) - 0.004), q}, report);
        const BoneContact& bone = engine.state().bone;
        if (bone.touching && !touched) {
          ++contacts;
          EXPECT_LT(patient.field.structuresDistance(bones, bone.p_proxy_W_m), 2e-4) << needle << ", " << k;
        }
        touched = bone.touching;
      }
    }
  }
  EXPECT_GT(contacts, 60);
}

TEST(VolumePatients, wrongPathsMeetWhatTheyName) {
  for (const Patient& patient : patients()) {
    for (const auto& wrong : patient.paths["wrong"]) {
      SCOPED_TRACE(patient.profile.id() + ": " + wrong["name"].get<std::string>());
      const Layers found = patient.through(pointOf(wrong["through_m"]), 0.06);
      const std::string meets = wrong["meets"];
      EXPECT_TRUE(std::ranges::any_of(found, [&](const auto& layer) { return layer.first == meets; }));
    }
  }
}

// as `profileWarnings` and the samples' friction judge a profile of layers
TEST(VolumePatients, everyLayerOnThePlannedPathCanBeFelt) {
  for (const Patient& patient : patients()) {
    SCOPED_TRACE(patient.profile.id());
    const Layers expected = layersOf(patient.paths["expected"]);
    double before_N = 0, friction_N = 0, share = 0;
    for (std::size_t i = 0; i + 1 < expected.size(); ++i) {
      const std::string& id = expected[i].first;
      const double thick_m = expected[i + 1].second - expected[i].second;
      const auto& structures = patient.profile.volume().structures();
      const auto structure = std::ranges::find(structures, id, [](const auto& one) { return one.id(); });
      ASSERT_NE(structure, structures.end());
      const pb::Layer& layer = structure->layer();
      EXPECT_GE(fidelity(before_N, layer.cutting_force_n(), 500, thick_m), 0.5) << id;
      if (layer.has_puncture()) {
        // the indentation at which k1 z + k2 z² = f
        const double k1 = layer.puncture().linear_n_per_m(), k2 = layer.puncture().quadratic_n_per_m2(),
                     f = layer.puncture().force_n();
        EXPECT_LT((std::sqrt(k1 * k1 + 4 * k2 * f) - k1) / (2 * k2), thick_m) << id;
      }
      if (id == patient.paths["target"]) break;
      before_N = layer.cutting_force_n();
      friction_N += layer.friction_n_per_m() * thick_m;
      share = friction_N / (friction_N + before_N);
    }
    EXPECT_GT(share, 0.15);
    EXPECT_LT(share, 0.25);
  }
}

}  // namespace
}  // namespace needlelab
