/// PALPATION on the twelve patients: what a finger feels over the landmark and beside it, and a ball that is
/// pressed deep over bone. The field is asked point by point, never the engine's pieces.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <numbers>
#include <utility>
#include <vector>

#include "common/haptics/body/path_stack.h"
#include "common/haptics/surface.h"
#include "tests/support/anatomy/late_paths.h"
#include "tests/unit/common/profile/patients_in_body.h"

namespace needlelab::test {
namespace {

using namespace patients_in_body;

constexpr double kLoop_hz = 1000;
constexpr double kBall_m = 0.003;

/// A capped tip that goes from place to place.
class CappedTip {
 public:
  explicit CappedTip(const SceneModel& model, PathMaker* paths = nullptr) : engine_(model, paths) {
    engine_.wantCap(true);
  }
  void at(Vec3 tip) { engine_.step({tip, {1, 0, 0, 0}}, report_); }
  void to(Vec3 tip, double speed_mps = 0.02) {
    const Vec3 from = tip_;
    const int ticks = std::max(1, static_cast<int>(norm(tip - from) / speed_mps * kLoop_hz));
    for (int k = 1; k <= ticks; ++k) at(from + (tip - from) * (k / static_cast<double>(ticks)));
    tip_ = tip;
  }
  void begin(Vec3 tip) {
    tip_ = tip;
    for (int k = 0; k < 20; ++k) at(tip);
  }
  [[nodiscard]] Vec3 force() const { return report_.wrench_W.force_N; }
  [[nodiscard]] const StepReport& report() const { return report_; }
  [[nodiscard]] SceneEngine& engine() { return engine_; }

 private:
  SceneEngine engine_;
  StepReport report_;
  Vec3 tip_;
};

struct Place {
  Vec3 at_m, out;
  double cover_m = 0;  ///< of bone, along the skin's normal; `deepest` if there is none
};

/// A place of the skin, and how far the ball may go in along the normal before it meets bone: by balls of
/// points that are asked one by one.
Place placeOn(const Patient& patient, Vec3 near_m, double deepest_m) {
  Place place;
  const Limb& limb = patient.scene.limb;
  place.at_m = nearestSkin(limb, near_m, {0, 0, -1});
  place.out = surfaceNormal(limb, place.at_m, {0, 0, -1});
  while (place.cover_m < deepest_m) {
    const Vec3 center = place.at_m + place.out * (kBall_m - place.cover_m);
    const double free_m = patient.fromBone(center) / kMostSteep - kBall_m;  // at least
    if (free_m > 2e-4) {
      place.cover_m += free_m;
      continue;
    }
    for (int i = 0; i < 60; ++i) {
      const double z = 1 - (2 * i + 1) / 60.0, r = std::sqrt(1 - z * z), turn = 2.399963 * i;
      const Vec3 point = center + Vec3{r * std::cos(turn), r * std::sin(turn), z} * kBall_m;
      if (patient.isBone(patient.field().at(point).structure)) return place;
    }
    place.cover_m += 2e-4;
  }
  return place;
}

/// The force over how deep the ball is pressed, along the normal.
std::vector<double> pressed(const Patient& patient, const Place& place, double deep_m) {
  CappedTip tip(*patient.model);
  tip.begin(place.at_m + place.out * (kBall_m + 0.01));
  tip.to(place.at_m + place.out * (kBall_m + 2e-5));
  std::vector<double> force_N;
  for (int k = 0; k * 2e-5 <= deep_m; ++k) {
    tip.at(place.at_m + place.out * (kBall_m - 2e-5 * k));
    force_N.push_back(dot(tip.force(), place.out));
  }
  return force_N;
}
double forceAt(const std::vector<double>& force_N, double deep_m) {
  return force_N.at(static_cast<std::size_t>(deep_m / 2e-5));
}
/// The greatest slope, over 0.2 mm, up to a force.
double steepest(const std::vector<double>& force_N, double most_N) {
  double steepest_N_per_m = 0;
  for (std::size_t i = 10; i < force_N.size() && force_N[i] <= most_N; ++i)
    steepest_N_per_m = std::max(steepest_N_per_m, (force_N[i] - force_N[i - 10]) / 2e-4);
  return steepest_N_per_m;
}

/// The landmark where its cover is least, of a raster on the skin, and the softest place of the raster.
std::pair<Place, Place> landmarkAndBeside(const Patient& patient) {
  const pb::Profile profile =
      *loadProfile(std::filesystem::path(NEEDLELAB_SAMPLES) / "volumes" / (patient.name + ".json"));
  const std::string id = profile.palpation().has_landmark() ? profile.palpation().landmark() : "l4";
  const auto& structures = patient.field().structures();
  const auto landmark = static_cast<StructureIndex>(std::ranges::find(structures, id, &FieldStructure::id) -
                                                    structures.begin());
  // the place of the landmark that is nearest to the skin, roughly
  Place nearest, softest;
  nearest.cover_m = 1;
  const FieldBox box = patient.field().boxAround(maskOf(landmark));
  constexpr int kRaster = 32;
  const Vec3 size = box.high_m - box.low_m;
  for (int i = 0; i <= kRaster; ++i)
    for (int j = 0; j <= kRaster; ++j)
      for (int k = 0; k <= kRaster; ++k) {
        const Vec3 p = box.low_m + Vec3{size.x * i, size.y * j, size.z * k} / kRaster;
        const double deep_m = patient.body->depth(p);
        if (deep_m > nearest.cover_m || patient.field().at(p).structure != landmark) continue;
        nearest.cover_m = deep_m;
        nearest.at_m = p;
      }
  const Vec3 about = nearest.at_m;
  nearest.cover_m = 1;
  for (int i = -20; i <= 20; ++i)
    for (int j = -20; j <= 20; ++j) {
      const Vec3 out = surfaceNormal(patient.scene.limb, about, {0, 0, -1});
      const Vec3 side = normalized(cross(out, std::fabs(out.x) < 0.9 ? Vec3{1, 0, 0} : Vec3{0, 1, 0}));
      const bool near = std::abs(i) <= 4 && std::abs(j) <= 4;
      if (!near && (i % 4 != 0 || j % 4 != 0)) continue;
      const Place place = placeOn(patient, about + side * (0.002 * i) + cross(out, side) * (0.002 * j), 0.03);
      if (near && place.cover_m < nearest.cover_m) nearest = place;
      if (place.cover_m > softest.cover_m) softest = place;
    }
  return {nearest, softest};
}

// A hand feels a landmark where pressing becomes harder than beside it, with less force than a device holds.
TEST(PalpationPatients, aLandmarkIsHarderThanTheSoftTissueBesideIt) {
  for (const Patient& patient : patients()) {
    SCOPED_TRACE(patient.name);
    if (patient.name == "lumbar-heavy") continue;  // it has none: 26 mm deep, it cannot be felt
    const auto [landmark, beside] = landmarkAndBeside(patient);
    ASSERT_LT(landmark.cover_m, 0.03);
    const std::vector<double> over = pressed(patient, landmark, landmark.cover_m + 0.002),
                              soft = pressed(patient, beside, 0.012);
    const double most_N = landmark.cover_m <= 0.010 ? 2.0 : 2.5;
    const double ratio = steepest(over, most_N) / steepest(soft, forceAt(soft, 0.005));
    std::printf(
        "%-16s cover %4.1f mm: bone at %.2f N, up to %.1f N %.1f times as hard as beside it, where "
        "5 mm take %.2f N\n",
        patient.name.c_str(), 1e3 * landmark.cover_m, forceAt(over, landmark.cover_m), most_N, ratio,
        forceAt(soft, 0.005));
    EXPECT_GE(forceAt(soft, 0.005), 0.5);
    EXPECT_LE(landmark.cover_m, 0.016);
    EXPECT_GE(ratio, 2);
    EXPECT_LE(forceAt(over, landmark.cover_m), 3) << "what motors hold";
  }
}

/// As a loop over the skin that dips to a depth and comes back to where it began.
Vec3 onLoop(const Place& place, const double (&phase)[3], double wide_m, double deep_m, double share) {
  const double turn = 2 * std::numbers::pi * share, fade = std::sin(std::numbers::pi * share);
  const Vec3 side =
      normalized(cross(place.out, std::fabs(place.out.x) < 0.9 ? Vec3{1, 0, 0} : Vec3{0, 1, 0}));
  return place.at_m + side * (wide_m * fade * std::sin(3 * turn + phase[0])) +
         cross(place.out, side) * (wide_m * fade * std::sin(2 * turn + phase[1])) +
         place.out * (0.006 - fade * (0.006 + deep_m * (0.6 + 0.4 * std::sin(4 * turn + phase[2]))));
}

// Pressed far deeper than its cover, over edges and into hollows: the ball that the bone's spring holds stays
// outside of bone, and the hand gets back no more than it gave.
TEST(PalpationPatients, aBallPressedIntoBoneStaysOutsideAndLoopsGiveNoEnergy) {
  constexpr int kTicks = 4000;
  const int loops = longForm() ? 40 : 4;
  std::size_t on_bone = 0;
  for (const Patient& patient : patients()) {
    SCOPED_TRACE(patient.name);
    SceneSpec scene = patient.scene;
    scene.max_force_N = 50;
    const auto model = std::make_unique<SceneModel>(*compile(scene, kLoop_hz));
    const Place landmark = landmarkAndBeside(patient).first;
    Random random(11);
    for (int loop = 0; loop < loops; ++loop) {
      const double phase[] = {random.in(0, 6), random.in(0, 6), random.in(0, 6)};
      const Place place =
          placeOn(patient, landmark.at_m + Vec3{random.in(-0.01, 0.01), random.in(-0.01, 0.01), 0}, 0.001);
      CappedTip tip(*model);
      Vec3 before, force_before;
      double given_J = 0, least_J = 0;
      for (int k = 0; k <= kTicks; ++k) {
        const Vec3 at = onLoop(place, phase, 0.012, 0.016, k / static_cast<double>(kTicks));
        tip.at(at);
        if (k > 0) given_J -= 0.5 * dot(tip.force() + force_before, at - before);
        least_J = std::min(least_J, given_J);
        before = at;
        force_before = tip.force();
        const ProxyContact& bone = tip.engine().state().palpation.bone;
        if (!bone.touching || !(tip.report().depth_m > -kBall_m)) continue;  // off the skin it lets go
        ++on_bone;
        if (k % 8 != 0) continue;
        for (int i = 0; i < 40; ++i) {
          const double z = 1 - (2 * i + 1) / 40.0, r = std::sqrt(1 - z * z), turn = 2.399963 * i + k;
          const Vec3 point =
              bone.p_proxy_W_m + Vec3{r * std::cos(turn), r * std::sin(turn), z} * (kBall_m - 1e-4);
          ASSERT_FALSE(patient.isBone(patient.field().at(point).structure)) << loop << ", tick " << k;
        }
      }
      for (int k = 0; k < 2000; ++k) tip.at(before);
      EXPECT_GT(least_J, -2e-6) << loop;
      EXPECT_EQ(tip.force(), Vec3{}) << "it ends off the skin";
    }
  }
  EXPECT_GT(on_bone, 20'000u * static_cast<unsigned>(loops) / 4);
}

/// One piece for the whole body, from the first tick on.
class WholeBody final : public PathMaker {
 public:
  explicit WholeBody(const SceneModel& body) : body_(body) {}
  void ask(const PathAsk& ask) noexcept override { ask_ = ask; }
  bool take(PathStack*& made) noexcept override {
    PathAsk whole = ask_;
    whole.ball_radius_m = 0.5;
    PathLayers path;
    made = findPath(body_, whole, path) ? compilePath(body_, path).release() : nullptr;
    return true;
  }
  void retire(PathStack* path) noexcept override { delete path; }

 private:
  const SceneModel& body_;
  PathAsk ask_;
};

// A piece that is exact has the bits of the whole: a new one changes no force, and a recording needs none.
TEST(PalpationPatients, aNewPieceOfTheBodyChangesNoForce) {
  for (const Patient& patient : patients()) {
    SCOPED_TRACE(patient.name);
    Random random(5);
    const double phase[] = {random.in(0, 6), random.in(0, 6), random.in(0, 6)};
    const Place place = placeOn(patient, {0, 0, 0.002}, 0.001);
    WholeBody whole(*patient.model);
    LatePaths late(*patient.model, [](int ask, const PathAsk&) { return ask % 7 == 3 ? 1 : 0; });
    CappedTip one(*patient.model), other(*patient.model, &whole), third(*patient.model, &late);
    int pieces = 0, kept = 0;
    for (int k = 0; k <= 5000; ++k) {
      const Vec3 at = onLoop(place, phase, 0.02, 0.010, k / 5000.0);
      for (CappedTip* tip : {&one, &other, &third}) tip->at(at);
      pieces += (one.report().flags & kFlagNewPath) != 0 ? 1 : 0;
      kept += (third.report().flags & kFlagKeptPath) != 0 ? 1 : 0;
      if (k < 20) continue;  // until the first piece there is no force
      ASSERT_EQ(one.force(), other.force()) << k;
      ASSERT_EQ(one.force(), third.force()) << k;
      ASSERT_EQ(one.report().depth_m, other.report().depth_m) << k;
    }
    EXPECT_GT(pieces, 40);
    EXPECT_GT(kept, 4);
  }
}

}  // namespace
}  // namespace needlelab::test
