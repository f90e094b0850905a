/// The patients of db/samples/volumes in the engine, and what their fields have along a line: found by asking
/// the field point by point, not by the engine's march.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/anatomy/field_body.h"
#include "common/haptics/body/body_engine.h"
#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"
#include "tests/support/random.h"
#include "tests/support/run_form.h"

namespace needlelab::patients_in_body {

inline constexpr double kRate_hz = 1000;
/// Each boundary is to be found within this.
inline constexpr double kBoundaryError_m = 1e-4;

/// A stretch of a line in one structure.
struct Stretch {
  StructureIndex structure = kOutside;
  double from_m = 0, to_m = 0;
  [[nodiscard]] double length_m() const { return to_m - from_m; }
};
using Stretches = std::vector<Stretch>;

struct Patient {
  std::string name;
  SceneSpec scene;
  std::shared_ptr<const SceneModel> model;
  std::shared_ptr<const FieldBody> body;
  StructureMask bones = 0;
  Vec3 planned;         ///< the direction of the planned line, from the origin
  double sliver_m = 0;  ///< half the needle's diameter: thinner layers go to the one before
  [[nodiscard]] const Field& field() const { return body->field(); }
  [[nodiscard]] bool isBone(StructureIndex structure) const {
    return structure != kOutside && (bones & maskOf(structure)) != 0;
  }
  [[nodiscard]] std::string id(int structure) const {
    return structure < 0 || structure == kOutside
               ? "none"
               : field().structures()[static_cast<std::size_t>(structure)].id;
  }
  /// From a bone's surface, negative in bone.
  [[nodiscard]] double fromBone(Vec3 p_m) const { return field().structuresDistance(bones, p_m); }
  /// How far the membrane at a structure's top stretches before it gives way; 0: it has none.
  [[nodiscard]] double stretchOf(StructureIndex structure) const {
    if (structure == kOutside || !scene.layers[structure].membrane) return 0;
    const MembraneSpec& m = *scene.layers[structure].membrane;
    const double k1 = m.linear_N_per_m, k2 = m.quadratic_N_per_m2;
    return (std::sqrt(k1 * k1 + 4 * k2 * m.force_N) - k1) / (2 * k2);
  }
};

/// The twelve, by name; read once.
inline const std::vector<Patient>& patients() {
  static const std::vector<Patient> all = [] {
    std::vector<Patient> found;
    for (const auto& entry :
         std::filesystem::directory_iterator(std::filesystem::path(NEEDLELAB_SAMPLES) / "volumes")) {
      const std::string name = entry.path().stem().string();
      if (entry.path().extension() != ".json" || name.find("curriculum") != std::string::npos) continue;
      const auto profile = loadProfile(entry.path());
      EXPECT_TRUE(profile.ok()) << name;
      Patient one;
      one.name = name;
      one.scene = *sceneSpecOf(*profile);
      auto model = compile(one.scene, kRate_hz);
      EXPECT_TRUE(model.ok()) << name;
      one.model = std::make_shared<SceneModel>(std::move(*model));
      const auto& limb = std::get<BodyLimb>(one.scene.limb);
      EXPECT_EQ(limb.X_WL, Pose{}) << "these tests know one frame";
      one.body = std::dynamic_pointer_cast<const FieldBody>(limb.body);
      for (std::size_t i = 0; i < one.scene.layers.size(); ++i)
        if (one.scene.layers[i].is_bone) one.bones |= maskOf(static_cast<StructureIndex>(i));
      const auto& aim = profile->targets(0).center_m();
      one.planned = normalized(Vec3{aim.x(), aim.y(), aim.z()});
      one.sliver_m = 0.5 * one.scene.needle_diameter_m;
      EXPECT_GT(one.sliver_m, 0) << name;
      found.push_back(std::move(one));
    }
    std::sort(found.begin(), found.end(), [](const Patient& a, const Patient& b) { return a.name < b.name; });
    EXPECT_EQ(found.size(), 12u);
    return found;
  }();
  return all;
}

/// A line; places on it are lengths from `origin_m`.
struct Line {
  Vec3 origin_m, axis;
  [[nodiscard]] Vec3 at(double s_m) const { return origin_m + axis * s_m; }
};

/// What the field has from `from_m` to `to_m`, asked every `step_m`; places that the field says to be of the
/// same structure are not asked one by one. A boundary is in the middle of its step.
inline Stretches sampled(const Patient& patient, const Line& line, double from_m, double to_m,
                         double step_m = 2e-5) {
  Stretches found;
  for (double s_m = from_m; s_m < to_m;) {
    const FieldPoint here = patient.field().at(line.at(s_m));
    if (found.empty() || found.back().structure != here.structure) {
      const double top_m = found.empty() ? from_m : s_m - 0.5 * step_m;
      if (!found.empty()) found.back().to_m = top_m;
      found.push_back({here.structure, top_m, to_m});
    }
    s_m += step_m * std::max(1.0, std::floor(0.99 * here.clearance_m / step_m));
  }
  return found;
}

/// Slivers go to the layer before; the last stretch, which the sampling ends, stays.
inline Stretches withoutSlivers(const Stretches& all, double sliver_m) {
  Stretches kept;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const bool goes = !kept.empty() && (kept.back().structure == all[i].structure ||
                                        (all[i].length_m() < sliver_m && i + 1 < all.size()));
    if (goes)
      kept.back().to_m = all[i].to_m;
    else
      kept.push_back(all[i]);
  }
  return kept;
}

inline StructureIndex structureAt(const Stretches& stretches, double s_m) {
  for (const Stretch& one : stretches)
    if (s_m >= one.from_m && s_m < one.to_m) return one.structure;
  return kOutside;
}
/// Whether a layer is right at a place, or at one nearer than a boundary's error.
inline bool isRight(const Stretches& stretches, double s_m, int layer) {
  for (const Stretch& one : stretches)
    if (s_m >= one.from_m - kBoundaryError_m && s_m < one.to_m + kBoundaryError_m && one.structure == layer)
      return true;
  return false;
}

/// The structure at a place on a line, where slivers belong to the layer before.
inline StructureIndex felt(const Patient& patient, const Line& line, double s_m) {
  const FieldPoint here = patient.field().at(line.at(s_m));
  if (2 * here.clearance_m > patient.sliver_m || here.structure == kOutside) return here.structure;
  const double around_m = 3 * patient.sliver_m;
  const Stretches near = sampled(patient, line, std::max(0.0, s_m - around_m), s_m + around_m, 1e-5);
  return structureAt(withoutSlivers(near, patient.sliver_m), s_m);
}

/// A line from the skin: `origin_m` is where it enters. Its entry is at a random place as far aside of the
/// planned one as `aside_m`, and it leans from the inward normal by at most `lean_rad`.
inline std::optional<Line> randomLine(const Patient& patient, test::Random& random, double aside_m,
                                      double lean_rad) {
  const Vec3 above{random.in(-aside_m, aside_m), random.in(-aside_m, aside_m), 0.03};
  double down_m = 0;  // the skin below or above the planned entry's height
  while (down_m < 0.09 && patient.field().skinDistance(above - Vec3{0, 0, down_m}) > 1e-7)
    down_m += std::max(1e-7, 0.8 * patient.field().skinDistance(above - Vec3{0, 0, down_m}));
  if (down_m >= 0.09 || down_m < 1e-4) return std::nullopt;
  const Vec3 entry = above - Vec3{0, 0, down_m}, inward = -patient.body->normal(entry);
  const Vec3 side = normalized(cross(inward, std::fabs(inward.x) < 0.9 ? Vec3{1, 0, 0} : Vec3{0, 1, 0}));
  const double around = random.in(0, 6.283185307), lean = random.in(0, lean_rad);
  const Vec3 across = side * std::cos(around) + cross(inward, side) * std::sin(around);
  return Line{entry, normalized(inward * std::cos(lean) + across * std::sin(lean))};
}

/// Turns a needle to an axis, by the shortest way from straight down.
inline Quat pointing(Vec3 axis) {
  const Vec3 down{0, 0, -1};
  if (dot(down, axis) < -0.999999) return {0, 0, 0, 1};
  const Vec3 turn = cross(down, axis);
  return normalized(Quat{turn.x, turn.y, turn.z, 1 + dot(down, axis)}) * Quat{1, 0, 0, 0};
}

/// A needle whose tip is put somewhere in each tick.
class Needle {
 public:
  explicit Needle(const Patient& patient) : Needle(*patient.model) {}
  explicit Needle(const SceneModel& model, PathMaker* paths = nullptr) : engine_(model, paths) {}
  const StepReport& at(Vec3 tip_m, Vec3 axis) {
    if (!(axis == axis_)) q_ = pointing(axis_ = axis);
    tip_m_ = tip_m;
    engine_.step({tip_m, q_}, report_);
    return report_;
  }
  /// Rests; a body finds its first path.
  void rest(Vec3 tip_m, Vec3 axis, int ticks = 60) {
    for (int i = 0; i < ticks; ++i) at(tip_m, axis);
  }
  /// Straight to a place; `each(report)` after every tick.
  template <class Each>
  void to(Vec3 place_m, double speed_mps, const Each& each) {
    const Vec3 from = tip_m_;
    const int ticks = std::max(1, static_cast<int>(std::ceil(norm(place_m - from) / speed_mps * kRate_hz)));
    for (int i = 1; i <= ticks; ++i)
      each(at(from + (place_m - from) * (static_cast<double>(i) / ticks), axis_));
  }
  void to(Vec3 place_m, double speed_mps) {
    to(place_m, speed_mps, [](const StepReport&) {});
  }
  [[nodiscard]] const StepReport& report() const { return report_; }
  [[nodiscard]] const SceneEngine& engine() const { return engine_; }
  [[nodiscard]] const SimState& state() const { return engine_.state(); }
  [[nodiscard]] Vec3 tip() const { return tip_m_; }
  [[nodiscard]] double bone_N() const {
    return report_.layer < 0 ? 0 : report_.stage_N[stageOf(Effect::kBone)];
  }
  /// The needle's own line in the tissue, and where on it the tip is.
  [[nodiscard]] Line ownLine() const { return {state().p_entry_W_m, state().u_W}; }
  [[nodiscard]] double onOwnLine() const { return dot(state().u_W, tip_m_ - state().p_entry_W_m); }

 private:
  SceneEngine engine_;
  StepReport report_;
  Vec3 tip_m_, axis_{2, 0, 0};
  Quat q_;
};

/// A hand: a spring of 300 N/m and a damper of 5 N·s/m hold 0.35 kg, whose needle's force is one tick late.
struct Hand {
  Vec3 place_m, speed_mps;
  void tick(Vec3 want_m, Vec3 force_N) {
    speed_mps += ((want_m - place_m) * 300 - speed_mps * 5 + force_N) / 0.35 / kRate_hz;
    place_m += speed_mps / kRate_hz;
  }
};

/// Right ticks of all.
struct Share {
  long right = 0, all = 0;
  void count(bool is_right) {
    right += is_right;
    ++all;
  }
  [[nodiscard]] double percent() const {
    return all > 0 ? 100.0 * static_cast<double>(right) / static_cast<double>(all) : 100;
  }
};

}  // namespace needlelab::patients_in_body
