#include "tests/support/view_lesson/sample_lesson.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "client/view/model/camera.h"
#include "common/haptics/engine.h"
#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"
#include "tests/support/scenes/stored_sample.h"

namespace needlelab::test {
namespace {

constexpr double kRateHz = 1000;

template <typename T>
T orEnd(Result<T> result) {
  if (result) return std::move(result).value();
  std::fprintf(stderr, "sample lesson: %s\n", result.error().message.c_str());
  std::abort();
}

// a hand's path between two points: starts and ends gently
double gently(double share) {
  const double t = std::clamp(share, 0.0, 1.0);
  return t * t * t * (10 - 15 * t + 6 * t * t);
}

}  // namespace

SampleLesson sampleLesson(const std::string& name, const LessonShape& shape) {
  SampleLesson lesson;
  lesson.profile = orEnd(loadProfile(std::filesystem::path(NEEDLELAB_SAMPLES) / (name + ".json")));
  lesson.scene = std::make_shared<const SceneView>(orEnd(sceneViewOf(lesson.profile)));
  lesson.model =
      std::make_shared<const SceneModel>(orEnd(compile(orEnd(sceneSpecOf(lesson.profile)), kRateHz)));

  const SceneView& scene = *lesson.scene;
  const Vec3 in = -scene.focus_normal_W;
  const OrbitCamera look = initialView(scene);
  const Vec3 side = normalized(cross(scene.focus_normal_W, look.front_W));
  const Vec3 axis = normalized(in + side * std::tan(shape.tilt_rad));
  const Vec3 aim = (scene.targets.empty() ? scene.focus_W_m + in * 0.02 : scene.targets.front().center_W_m) +
                   side * shape.lateral_m + axis * shape.beyond_m;
  const double way_m = norm(aim - scene.focus_W_m) * 1.08 + 0.4 * scene.extent_m;
  const Quat q = normalized(Quat{-axis.y, axis.x, 0, 1 + axis.z});
  const Quat facing = axis.z > -0.999999 ? q : Quat{1, 0, 0, 0};

  const double total_s = shape.approach_s + shape.insert_s + shape.rest_s + shape.withdraw_s;
  auto state = std::make_unique<SimState>();
  StepReport report;
  for (std::uint64_t tick = 0; static_cast<double>(tick) / kRateHz < total_s; ++tick) {
    const double t = static_cast<double>(tick) / kRateHz;
    double left = 1 - 0.25 * gently(t / shape.approach_s);
    const double in_share = gently((t - shape.approach_s) / shape.insert_s);
    const double out_share =
        gently((t - shape.approach_s - shape.insert_s - shape.rest_s) / shape.withdraw_s);
    left = left * (1 - in_share) + out_share;
    const Vec3 tremor = side * (0.00015 * std::sin(2 * 3.14159265 * 9 * t)) +
                        axis * (0.00004 * std::sin(2 * 3.14159265 * 11 * t));
    // the hand sways, so that the needle tilts
    const double sway = 0.06 * std::sin(2 * 3.14159265 * 0.45 * t);
    const Vec3 about = cross(axis, side);
    const Quat swing{about.x * std::sin(sway / 2), about.y * std::sin(sway / 2), about.z * std::sin(sway / 2),
                     std::cos(sway / 2)};
    const TipSample tip{aim - axis * (way_m * left) + tremor, normalized(swing * facing)};
    step(*lesson.model, tip, *state, report);
    GestureSample sample = storedSample(tick, tip, report);
    sample.plunger = 0.15 + 0.6 * gently((t - shape.approach_s - shape.insert_s) / shape.rest_s);
    lesson.samples.push_back(sample);
    lesson.reports.push_back(report);
  }
  return lesson;
}

}  // namespace needlelab::test
