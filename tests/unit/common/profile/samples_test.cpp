// Checks the profiles and the curricula in db/samples against their README.
#include <gmock/gmock.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>
#include <set>

#include "common/base/files/files.h"
#include "common/haptics/engine.h"
#include "common/profile/layer_names.h"
#include "common/profile/planned_line.h"
#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"
#include "common/profile/warnings.h"

namespace needlelab {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::UnorderedElementsAreArray;

const std::filesystem::path kSamples = NEEDLELAB_SAMPLES;

const std::vector<std::string> kPatients = {
    "shoulder-adult", "shoulder-muscular",  "shoulder-frail", "knee-adult",   "wrist-adult",  "lumbar-adult",
    "deltoid-adult",  "shoulder-posterior", "hip-adult",      "finger-adult", "carpal-tunnel"};
/// The courses by file, each with its patients.
const std::map<std::string, std::vector<std::string>> kCourses = {
    {"curriculum",
     {"shoulder-adult", "shoulder-muscular", "shoulder-frail", "knee-adult", "wrist-adult", "lumbar-adult",
      "phantom-ball"}},
    {"injection-steps-curriculum",
     {"deltoid-adult", "shoulder-posterior", "knee-adult", "hip-adult", "finger-adult", "carpal-tunnel"}}};
const std::string kPhantom = "phantom-ball";
const std::string kModels = "shoulder-models";
const std::vector<std::string> kPaper = {"paper-1dof", "paper-six-layers", "paper-clamping"};

pb::Profile sample(const std::string& id) {
  auto profile = loadProfile(kSamples / (id + ".json"));
  EXPECT_TRUE(profile.ok()) << (profile.ok() ? "" : profile.error().message);
  return profile.ok() ? std::move(profile).value() : pb::Profile();
}

std::vector<std::string> all() {
  std::vector<std::string> ids = kPatients;
  ids.insert(ids.end(), kPaper.begin(), kPaper.end());
  ids.push_back(kPhantom);
  ids.push_back(kModels);
  return ids;
}

Vec3 vec(const pb::Vector3& v) {
  return {v.x(), v.y(), v.z()};
}

double depth(const pb::Profile& profile, Vec3 p) {
  const auto& limb = profile.limb();
  const auto toSegment = [&](Vec3 a, Vec3 b) {
    const double t = std::clamp(dot(p - a, b - a) / normSquared(b - a), 0.0, 1.0);
    return norm(p - a - t * (b - a));
  };
  if (limb.has_plane()) return -dot(normalized(vec(limb.plane().normal())), p - vec(limb.plane().point_m()));
  if (limb.has_sphere()) return limb.sphere().radius_m() - norm(p - vec(limb.sphere().center_m()));
  return limb.capsule().radius_m() - toSegment(vec(limb.capsule().a_m()), vec(limb.capsule().b_m()));
}

double distance(const pb::Hazard& hazard, Vec3 p) {
  if (hazard.has_center_m()) return norm(p - vec(hazard.center_m())) - hazard.radius_m();
  const Vec3 a = vec(hazard.a_m()), b = vec(hazard.b_m());
  const double t = std::clamp(dot(p - a, b - a) / normSquared(b - a), 0.0, 1.0);
  return norm(p - a - t * (b - a)) - hazard.radius_m();
}

TEST(Samples, theFolderHoldsTheseAndNoOther) {
  std::set<std::string> found, expected = {"README.md", "volumes"};
  for (const auto& [file, patients] : kCourses) expected.insert(file + ".json");
  for (const std::string& id : all()) expected.insert(id + ".json");
  for (const auto& entry : std::filesystem::directory_iterator(kSamples))
    found.insert(entry.path().filename());
  EXPECT_EQ(found, expected);
}

TEST(Samples, areCanonicalWithoutWarningsAndNameTheirSources) {
  for (const std::string& id : all()) {
    SCOPED_TRACE(id);
    const pb::Profile profile = sample(id);
    EXPECT_EQ(profile.id(), id) << "the file is named by its id";
    EXPECT_EQ(profileJson(profile), *readWholeFile(kSamples / (id + ".json")));
    EXPECT_THAT(profileWarnings(profile), IsEmpty());
    EXPECT_THAT(profile.sources(), HasSubstr("paper"));
    EXPECT_THAT(profile.sources(), HasSubstr("set by hand"));
    EXPECT_FALSE(profile.targets().empty());
    EXPECT_NEAR(depth(profile, {0, 0, 0}), 0, 1e-12) << "the skin is at the origin";
    EXPECT_LT(depth(profile, {0, 0, 1e-3}), 0) << "z points out of the body";
  }
}

/// `+y "towards the head", −y "down the arm"`
std::string directionsText(const pb::Directions& directions) {
  std::string text;
  const auto add = [&](const char* way, const std::string& name) {
    if (!name.empty()) text += (text.empty() ? "" : ", ") + std::string(way) + " \"" + name + "\"";
  };
  add("+x", directions.plus_x());
  add("−x", directions.minus_x());
  add("+y", directions.plus_y());
  add("−y", directions.minus_y());
  add("+z", directions.plus_z());
  add("−z", directions.minus_z());
  return text;
}

TEST(Samples, theDirectionsAreThoseOfTheReadme) {
  const std::string readme = *readWholeFile(kSamples / "README.md");
  const std::string table = readme.substr(readme.find("| profile | names | known from |"));
  const std::string rows = table.substr(0, table.find("\n\n"));
  for (const std::string& id : all()) {
    SCOPED_TRACE(id);
    const std::string text = directionsText(sample(id).directions());
    const std::size_t at = rows.find("`" + id + ".json`");
    ASSERT_EQ(at != std::string::npos, !text.empty());
    if (text.empty()) continue;
    const std::string row = rows.substr(at, rows.find('\n', at) - at);
    EXPECT_THAT(row, HasSubstr("| " + text + " |"));
  }
}

/// A hazard's centre, in L.
Vec3 middleOf(const pb::Profile& profile, const std::string& name) {
  for (const auto& hazard : profile.hazards())
    if (hazard.name() == name)
      return hazard.has_center_m() ? vec(hazard.center_m()) : 0.5 * (vec(hazard.a_m()) + vec(hazard.b_m()));
  ADD_FAILURE() << name;
  return {};
}

TEST(Samples, theDirectionsAgreeWithTheAnatomy) {
  for (const char* id : {"shoulder-adult", "shoulder-frail", "shoulder-muscular", "shoulder-models"})
    EXPECT_LT(middleOf(sample(id), "axillary nerve").y, 0) << id << ": it crosses the arm below";
  EXPECT_GT(middleOf(sample("knee-adult"), "patella").x, 0) << "the recess is above the patella";
  EXPECT_GT(middleOf(sample("wrist-adult"), "superficial radial nerve").y, 0) << "on the thumb's side";
  EXPECT_LT(middleOf(sample("carpal-tunnel"), "ulnar artery").y, 0) << "on the little finger's side";
  EXPECT_LT(middleOf(sample("lumbar-adult"), "spinous process above").x, 0);
  EXPECT_GT(middleOf(sample("hip-adult"), "femoral vein").y, 0) << "medial of the nerve";
  EXPECT_GT(middleOf(sample("shoulder-posterior"), "glenoid rim").x,
            middleOf(sample("shoulder-posterior"), "humeral head").x)
      << "the glenoid is medial of the head";
}

TEST(Samples, noPatientLayerIsNamedByANumber) {
  for (const std::string& id : all()) {
    if (id == "paper-1dof") continue;  // the paper's single layer has no tissue
    for (const std::string& name : layerNames(sample(id)))
      EXPECT_EQ(name.find_first_of("0123456789"), std::string::npos) << id << ": " << name;
  }
  EXPECT_EQ(layerNames(sample("lumbar-adult")),
            (std::vector<std::string>{"skin", "subcutaneous fat", "interspinous ligament",
                                      "ligamentum flavum", "epidural space", "dura and vertebra"}));
}

TEST(Samples, patientsHaveEveryEffectPassively) {
  for (const std::string& id : kPatients) {
    SCOPED_TRACE(id);
    const pb::Profile profile = sample(id);
    EXPECT_EQ(sceneSpecOf(profile)->effects & kPlacedEffects, kPlacedEffects);
    EXPECT_EQ(profile.virtual_fixture().mode(), pb::VirtualFixture::CONSERVATIVE);
    EXPECT_FALSE(profile.hazards().empty());
  }
}

bool samplesList(const std::string& id, Effect effect) {
  return (sceneSpecOf(sample(id))->effects & bitOf(effect)) != 0;
}

TEST(Samples, fourHaveBoneThatNoNeedleEntersAndTwoRememberACut) {
  const std::set<std::string> bone = {"knee-adult", "lumbar-adult", "shoulder-adult", "wrist-adult"};
  const std::set<std::string> memory = {"knee-adult", "lumbar-adult"};
  for (const std::string& id : all()) {
    EXPECT_EQ(samplesList(id, Effect::kBone), bone.contains(id)) << id;
    EXPECT_EQ(samplesList(id, Effect::kCutMemory), memory.contains(id)) << id;
  }
}

// the wrist: bone 11.2 mm below the skin, 0.2 mm behind the target; with the fixture's 300 N/m within the
// Desktop's 1000
TEST(Samples, theWristsBoneHoldsTheNeedle) {
  const auto model = compile(*sceneSpecOf(sample("wrist-adult")), 1000);
  ASSERT_TRUE(model.ok()) << model.error().message;
  const auto state = std::make_unique<SimState>();
  StepReport report;
  for (int k = -10; k <= 300; ++k) {
    const double depth_m = 1e-5 + 5e-5 * k;  // never on the surface itself
    step(*model, {{0, 0, -depth_m}, {1, 0, 0, 0}}, *state, report);
    const double pressed_N = 600 * std::max(0.0, depth_m - 0.0112);
    ASSERT_NEAR(report.stage_N[stageOf(Effect::kBone)], pressed_N, 1e-9) << depth_m;
    ASSERT_EQ(report.layer == 4, pressed_N > 1e-9) << depth_m;
  }
}

TEST(Samples, whatActsAtOnceIsWithinWhatTheDesktopCanRender) {
  for (const std::string& id : all()) {
    const auto model = compile(*sceneSpecOf(sample(id)), 1000);
    ASSERT_TRUE(model.ok()) << model.error().message;
    EXPECT_LE(model->axialStiffness_N_per_m(), 1000) << id;
  }
}

TEST(Samples, aStraightNeedleReachesTheTargetPastEveryHazard) {
  for (const std::string& id : all()) {
    SCOPED_TRACE(id);
    const pb::Profile profile = sample(id);
    for (const auto& target : profile.targets()) {
      const Vec3 center = vec(target.center_m());
      EXPECT_GT(depth(profile, center), target.radius_m()) << "the whole target lies in the tissue";
      EXPECT_LT(norm(center), profile.needle().length_m()) << "the needle is long enough";
      for (const auto& hazard : profile.hazards()) {
        SCOPED_TRACE(hazard.name());
        EXPECT_GT(distance(hazard, center), target.radius_m()) << "the target is clear of it";
        for (int i = 0; i <= 100; ++i) {
          EXPECT_GT(distance(hazard, center * (i / 100.0)), 0.001) << "so is the straight way, by 1 mm";
        }
      }
    }
    for (const auto& hazard : profile.hazards()) {
      const Vec3 middle =
          hazard.has_center_m() ? vec(hazard.center_m()) : 0.5 * (vec(hazard.a_m()) + vec(hazard.b_m()));
      EXPECT_GT(depth(profile, middle), 0) << hazard.name() << " lies in the tissue";
    }
  }
}

TEST(Samples, frictionIsAboutAFifthOfTheForceBeforeTheTarget) {
  for (const std::string& id : kPatients) {
    const pb::Profile profile = sample(id);
    const double target_depth = depth(profile, vec(profile.targets(0).center_m()));
    double top = 0, friction = 0, cutting = 0;
    for (const auto& layer : profile.layers()) {
      if (top + layer.thickness_m() > target_depth) break;
      top += layer.thickness_m();
      friction += layer.thickness_m() * layer.friction_n_per_m();
      cutting = layer.cutting_force_n();
    }
    EXPECT_GT(friction / (friction + cutting), 0.15) << id;
    EXPECT_LT(friction / (friction + cutting), 0.25) << id;
  }
}

TEST(Samples, thePaperOnesHaveThePapersNumbersAndEffects) {
  const pb::Profile one = sample("paper-1dof");
  EXPECT_EQ(sceneSpecOf(one)->effects, bitOf(Effect::kCutting) | bitOf(Effect::kAttracted));
  EXPECT_EQ(one.layers(0).cutting_force_n(), 1);
  EXPECT_EQ(one.layers(0).attracted_force_n(), 0.5);

  const pb::Profile six = sample("paper-six-layers");
  EXPECT_EQ(sceneSpecOf(six)->effects, bitOf(Effect::kCutting) | bitOf(Effect::kAttracted));
  EXPECT_EQ(six.tracking_wall().stiffness_n_per_m(), 500);
  std::vector<double> cutting, attracted;
  for (const auto& layer : six.layers()) {
    cutting.push_back(layer.cutting_force_n());
    attracted.push_back(layer.attracted_force_n());
  }
  EXPECT_EQ(cutting, (std::vector<double>{1, 2, 1.5, 2.5, 3, 4}));
  EXPECT_EQ(attracted, (std::vector<double>(6, 0.4)));

  const pb::Profile clamping = sample("paper-clamping");
  EXPECT_EQ(sceneSpecOf(clamping)->effects, bitOf(Effect::kClamping));
  EXPECT_EQ(clamping.virtual_fixture().mode(), pb::VirtualFixture::PROPORTIONAL);
}

TEST(Samples, theCoursesUseTheirPatientsAndAreCanonical) {
  std::set<std::string> ids;
  std::set<std::string> used_by_any;
  for (const auto& [file, patients] : kCourses) {
    SCOPED_TRACE(file);
    const auto curriculum = loadCurriculum(kSamples / (file + ".json"));
    ASSERT_TRUE(curriculum.ok()) << curriculum.error().message;
    EXPECT_EQ(curriculumJson(*curriculum), *readWholeFile(kSamples / (file + ".json")));
    std::vector<std::string> used;
    for (const auto& exercise : curriculum->exercises()) {
      used.push_back(exercise.profile_id());
      used_by_any.insert(exercise.profile_id());
      EXPECT_TRUE(ids.insert(exercise.id()).second) << exercise.id() << " stands in two courses";
      EXPECT_GE(exercise.requirements_size(), 3) << exercise.id();
      const Status plan = checkPlan(exercise, sample(exercise.profile_id()), exercise.id());
      EXPECT_TRUE(plan.ok()) << plan.error().message;
    }
    EXPECT_THAT(used, UnorderedElementsAreArray(patients));
  }
  for (const std::string& id : kPatients) EXPECT_TRUE(used_by_any.contains(id)) << id;
}

TEST(Samples, noPhantomHasTheNameOfABody) {
  std::set<std::string> names;
  for (const std::string file : {"curriculum", "injection-steps-curriculum", "volumes/bodies-curriculum"}) {
    const auto course = loadCurriculum(kSamples / (file + ".json"));
    ASSERT_TRUE(course.ok()) << course.error().message;
    EXPECT_EQ(course->name().starts_with("Phantoms: "), course->id() != "bodies") << course->name();
    for (const auto& exercise : course->exercises())
      EXPECT_TRUE(names.insert(exercise.name()).second) << exercise.name() << " stands twice";
  }
}

TEST(Samples, theBursasPlanGoesToItsMiddle) {
  const auto course = loadCurriculum(kSamples / "curriculum.json");
  ASSERT_TRUE(course.ok()) << course.error().message;
  int plans = 0;
  for (const auto& exercise : course->exercises()) {
    const auto line = plannedLineOf(exercise);
    if (!line) continue;
    ++plans;
    EXPECT_EQ(exercise.id(), "shoulder-bursa");
    EXPECT_NEAR(distanceFrom(*line, vec(sample(exercise.profile_id()).targets(0).center_m())), 0, 1e-12);
  }
  EXPECT_EQ(plans, 1);
}

TEST(Samples, smallJointsAreInjectedWithoutTouchingTheBoneBelowTheirTarget) {
  std::set<std::string> required;
  for (const auto& [file, patients] : kCourses) {
    const auto course = loadCurriculum(kSamples / (file + ".json"));
    ASSERT_TRUE(course.ok()) << course.error().message;
    for (const auto& exercise : course->exercises()) {
      for (const auto& requirement : exercise.requirements()) {
        if (requirement.measure() != "bone_contacts") continue;
        required.insert(exercise.id());
        EXPECT_TRUE(requirement.has_max() && requirement.max() == 0 && !requirement.has_min());
        const pb::Profile patient = sample(exercise.profile_id());
        double bone_m = 0;
        for (const auto& layer : patient.layers()) {
          if (layer.tissue() == pb::Layer::BONE) break;
          bone_m += layer.thickness_m();
        }
        // straight below the entry, at the origin
        const auto& target = patient.targets(0);
        EXPECT_EQ(target.center_m().x(), 0);
        EXPECT_EQ(target.center_m().y(), 0);
        EXPECT_LT(-target.center_m().z() + target.radius_m(), bone_m) << "who stays in the target passes";
      }
    }
  }
  EXPECT_EQ(required, (std::set<std::string>{"step-5-small", "wrist-joint"}));
}

// graded: the first with all aids and no conditions, the last without aids and only after the first is passed
TEST(Samples, theStepsAreGraded) {
  const auto steps = loadCurriculum(kSamples / "injection-steps-curriculum.json");
  ASSERT_TRUE(steps.ok()) << steps.error().message;
  EXPECT_EQ(steps->id(), "injection-steps");
  ASSERT_EQ(steps->exercises_size(), 6);
  int aids = 6;
  for (const auto& exercise : steps->exercises()) {
    ASSERT_TRUE(exercise.has_aids()) << exercise.id();
    EXPECT_LE(exercise.aids().allowed_size(), aids) << exercise.id();
    aids = exercise.aids().allowed_size();
  }
  EXPECT_EQ(aids, 0);
  EXPECT_EQ(steps->exercises(0).prerequisites_size(), 0);
  EXPECT_EQ(steps->exercises(5).prerequisites(0), steps->exercises(0).id());
  // the oblique ones: the straight path in is not the shortest
  for (const char* const id : {"shoulder-posterior", "carpal-tunnel"}) {
    const Vec3 target = vec(sample(id).targets(0).center_m());
    EXPECT_GT(std::hypot(target.x, target.y) / norm(target), std::sin(0.3)) << id;
  }
  // At the shoulder, the shortest path hits bone.
  const pb::Profile shoulder = sample("shoulder-posterior");
  const Vec3 target = vec(shoulder.targets(0).center_m()), middle = vec(shoulder.limb().sphere().center_m());
  const Vec3 out = normalized(target - middle);
  double nearest = 1;
  for (int i = 0; i <= 100; ++i)
    nearest =
        std::min(nearest, distance(shoulder.hazards(0), target + out * (depth(shoulder, target) * i / 100)));
  EXPECT_LT(nearest, 0);
  // the nerve is beside the path
  const pb::Profile wrist = sample("carpal-tunnel");
  EXPECT_EQ(wrist.hazards(0).kind(), pb::Hazard::NERVE);
  EXPECT_NEAR(distance(wrist.hazards(0), vec(wrist.targets(0).center_m())), 0.003, 0.0005);
}

TEST(Samples, everyAxialModelWorksWithTheSampleOfAllSections) {
  for (const std::string_view name : kAxialModelNames) {
    pb::Profile profile = sample(kModels);
    const Status chosen = chooseModel(profile, std::string(name));
    ASSERT_TRUE(chosen.ok()) << chosen.error().message;
    const auto again = parseProfile(profileJson(profile), "again");
    ASSERT_TRUE(again.ok()) << again.error().message;
    EXPECT_EQ(axialModelName(sceneSpecOf(*again)->axial_model), name);
  }
}

}  // namespace
}  // namespace needlelab
