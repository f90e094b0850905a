/// Reads tests/stability/cases.json, the only source of the hard cases' scenes, paths, durations, limits and
/// seeds. The file is compiled into the program.
#pragma once

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "client/device/hand/hand_plan.h"
#include "client/sim/stability/gestures/passivity_gesture.h"
#include "client/sim/stability/loop/measures.h"
#include "client/sim/stability/loop/plant.h"
#include "common/base/program.h"
#include "common/base/result.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

/// The file: `{"version": 1, "plant": …, "scenes": {NAME: profile}, "cases": {NAME: …}}`.
class CaseFile {
 public:
  /// `source` names the text in messages. Errors: kInvalidInput naming file, field, value and range.
  static Result<CaseFile> parse(std::string_view text, std::string_view source);
  static Result<CaseFile> load(const std::filesystem::path& path);
  /// The compiled-in file.
  static Result<CaseFile> embedded();

  [[nodiscard]] const nlohmann::json& json() const { return json_; }
  [[nodiscard]] const std::string& source() const { return source_; }

 private:
  nlohmann::json json_;
  std::string source_;
};

/// The profiles in db/samples that have layers, compiled in: NAME.json. A case's scene may be one of them.
std::span<const EmbeddedFile> samplePatients();

/// Into the tissue, in W: the direction of the paths in cases.json.
inline constexpr Vec3 kInward_W{0, 0, -1};
/// A needle that points down, with its tip at this depth and offset.
inline Pose upright(double depth_m, double aside_m = 0) {
  return {{aside_m, 0, -depth_m}, orientationAlong(kInward_W)};
}

/// A hand's plan with the times of its steps.
struct TimedPlan {
  struct Step {
    std::string name;  ///< may be empty
    double from_s = 0, to_s = 0;
  };
  HandPlan plan{Pose{}};
  std::vector<Step> steps;
};

/// Changes to a path, for cases that draw it at random.
struct PathChange {
  double depth_offset_m = 0;  ///< added to every `to_depth_m` above 0
  double speed_factor = 1;    ///< of the steps named `speed_step`; if that is empty, of all steps
  std::string speed_step = {};
  double depth_factor = 1;  ///< of every `to_depth_m` above 0, before `depth_offset_m`
};

/// Reads one case's entry; "like" takes another case's entry, overridden by this one's fields (RFC 7386).
/// Keeps the first error, and every later read returns a harmless value: read everything, then check
/// `status()`. Field names are dotted paths: "window.from_s".
class CaseEntry {
 public:
  /// `case_name` must be in the file (kInvalidInput otherwise, through `status`).
  CaseEntry(const CaseFile& file, std::string_view case_name, bool long_form = false);

  [[nodiscard]] const Status& status() const { return status_; }
  [[nodiscard]] bool has(const std::string& field) const;
  /// A finite number within [least, most].
  double number(const std::string& field, double least = -1e9, double most = 1e9);
  /// A list of finite numbers, at least one.
  std::vector<double> numbers(const std::string& field);
  /// A whole number of at least `least`, or `{"short": n, "long": n}` for the two forms.
  std::uint64_t whole(const std::string& field, std::uint64_t least = 0);
  std::string text(const std::string& field);
  /// Interpolates `{"low": a, "high": b}` at `s` (0-1).
  double between(const std::string& field, double s);

  /// The scene or sample patient named by "scene", changed by the entry's "scene_patch" (RFC 7386) if
  /// present.
  SceneSpec scene();
  /// The file's "plant", overridden by the entry's "plant".
  PlantOptions plant();
  /// The list `field` of steps, straight along W's −z: first `{"from_depth_m"}`, then `{"hold_s"}` or
  /// `{"to_depth_m", "speed_m_s", "motion"}`; each may have a "name". Depth −10 mm to 1 m.
  TimedPlan path(const std::string& field = "path", const PathChange& change = {});
  /// `field`: `{"step", "from_s", "to_s"}`, in seconds after the start of that step of the path; without
  /// "to_s" until its end.
  TimeWindow window(const TimedPlan& plan, const std::string& field = "window");
  /// The prescribed motion in "motion", without a scene.
  PassivityGesture motion();

 private:
  [[nodiscard]] const nlohmann::json* find(const std::string& field) const;
  const nlohmann::json& need(const std::string& field);
  void fail(const std::string& field, const std::string& message);

  const CaseFile* file_;
  std::string name_;
  bool long_form_;
  nlohmann::json entry_;
  Status status_;
};

}  // namespace needlelab
