// A lesson with PALPATION, as a station runs it: a simulated hand feels for the landmark of each patient,
// takes the cap off, and reaches the target.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "client/device/hand/hand_options.h"
#include "client/device/hand/simulated_device.h"
#include "client/device/haptic_chain.h"
#include "client/station/run/lesson/lesson.h"
#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"
#include "common/scoring/measures/measures.h"

namespace needlelab::test {
namespace {

constexpr const char* kPatients[] = {"shoulder-slender", "shoulder-median", "shoulder-heavy", "knee-slender",
                                     "knee-median",      "knee-heavy",      "wrist-slender",  "wrist-median",
                                     "wrist-heavy",      "lumbar-slender",  "lumbar-median",  "lumbar-heavy"};
constexpr double kRate_hz = 1000;

struct PalpationLesson {
  pb::Profile profile;
  std::vector<GestureSample> samples;
};

PalpationLesson lessonOn(const std::string& patient, bool capped) {
  PalpationLesson lesson;
  const auto profile =
      loadProfile(std::filesystem::path(NEEDLELAB_SAMPLES) / "volumes" / (patient + ".json"));
  EXPECT_TRUE(profile.ok());
  lesson.profile = *profile;
  const auto scene = sceneSpecOf(*profile);
  const auto model = std::make_unique<SceneModel>(*compile(*scene, kRate_hz));
  SimulatedDeviceOptions options;
  options.hand.correction_per_s = kCommandLineCorrection_per_s;
  options.hand.bracing_N_per_m = kBracing_N_per_m;
  options.hand.hold_s = 1;
  options.hand.capped = capped;
  auto plan = choosePlan(options.hand, *scene, targetsOf(*profile, {}));
  EXPECT_TRUE(plan.ok()) << plan.error().message;
  SimulatedDevice device(options, *std::move(plan));
  EXPECT_TRUE(device.open(kRate_hz).ok());
  HapticChain chain(*model, device.info(), {});
  chain.beginCapped();
  // how far both springs may stretch in a tick (FORCE_MODEL.md, "Palpation")
  const pb::Palpation& numbers = profile->palpation();
  const double ks = numbers.skin_stiffness_n_per_m(), kp = numbers.bone_stiffness_n_per_m(),
               mu = numbers.friction_coefficient(), fall_m = 0.020 / kRate_hz;
  DeviceReading reading;
  ChainTick tick, before;
  for (std::int64_t k = 0; device.read(reading) != DeviceRead::kFinished; ++k) {
    device.write(chain.tick(reading, true, 1, 1.0, tick));
    EXPECT_EQ(tick.fault, Fault::kNone);
    if (k > 0 && (tick.report.flags & before.report.flags & kFlagCapped) != 0) {
      const double way_m = norm(tick.X_WT.p - before.X_WT.p);
      EXPECT_LT(
          norm(tick.report.wrench_W.force_N - before.report.wrench_W.force_N),
          ks * (std::sqrt(2 + mu * mu) * way_m + fall_m) + kp * (std::sqrt(2.0) * way_m + fall_m) + 1e-6)
          << k;
    }
    before = tick;
    lesson.samples.push_back(sampleOf(tick, k * 1'000'000, 0, 0));
  }
  return lesson;
}

double valueOf(const std::vector<Measure>& score, const std::string& name) {
  const auto row = std::ranges::find(score, name, &Measure::name);
  return row == score.end() ? std::nan("") : row->value;
}

TEST(PalpationLesson, aHandFindsEachPatientsLandmarkThenTheTarget) {
  for (const char* const patient : kPatients) {
    SCOPED_TRACE(patient);
    const PalpationLesson lesson = lessonOn(patient, true);
    const std::vector<Measure> score = scoreGesture(lesson.samples, kRate_hz, lesson.profile, {});
    const auto has = [](std::uint32_t flag) {
      return [flag](const GestureSample& sample) { return (sample.flags & flag) != 0; };
    };
    const auto entry = std::ranges::find_if(lesson.samples, has(kFlagEntry));
    ASSERT_NE(entry, lesson.samples.end());
    const auto still_on = std::find_if(entry, lesson.samples.end(), has(kFlagCapped));
    EXPECT_EQ(still_on, lesson.samples.end()) << "the cap stays off";
    const double entry_s = static_cast<double>(entry - lesson.samples.begin()) / kRate_hz;
    // a landmark that takes more force than motors hold is not one
    if (lesson.profile.palpation().has_landmark()) {
      EXPECT_GT(valueOf(score, "landmark_s"), 0.3);
      EXPECT_LT(valueOf(score, "landmark_s"), entry_s);
    } else {
      EXPECT_EQ(std::string(patient), "lumbar-heavy");
      EXPECT_TRUE(std::isnan(valueOf(score, "landmark_s")));
    }
    EXPECT_EQ(valueOf(score, "entries"), 1);
    EXPECT_EQ(valueOf(score, "target_reached"), 1);
    EXPECT_EQ(valueOf(score, "bone_contacts"), 0);
    double peak_N = 0;
    for (auto sample = lesson.samples.begin(); sample != entry; ++sample)
      peak_N = std::max(peak_N, std::hypot(sample->force_W_N[0], sample->force_W_N[1], sample->force_W_N[2]));
    if (lesson.profile.palpation().has_landmark()) EXPECT_GT(peak_N, 2);
    EXPECT_LT(peak_N, 3.5) << "motors hold 3 N for longer";
    EXPECT_LT(valueOf(score, "peak_force_n"), 5) << "of the needle: presses do not count";
  }
}

TEST(PalpationLesson, aHandThatKeepsTheCapOnNeverEnters) {
  const PalpationLesson lesson = lessonOn("knee-median", false);
  const auto force = [](const GestureSample& sample) { return std::abs(sample.force_W_N[2]); };
  EXPECT_GT(force(*std::ranges::max_element(lesson.samples, {}, force)), 2) << "it presses";
  EXPECT_TRUE(std::ranges::all_of(lesson.samples, [](const GestureSample& sample) {
    return sample.layer == -1 && (sample.flags & (kFlagCapped | kFlagNotStepped)) != 0;
  }));
}

}  // namespace
}  // namespace needlelab::test
