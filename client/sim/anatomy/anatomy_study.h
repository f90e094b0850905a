/// What a layer stack costs and how far off it is: marches of several steps through a patient's field,
/// against a march of 0.02 mm that asks the field at every step. In millimetres of a boundary, and in newtons
/// of the engine that gets the stack.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "common/anatomy/march.h"
#include "common/base/result.h"
#include "common/haptics/scene_model.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// A straight needle path: where it enters the skin, and its unit direction.
struct AnatomyPath {
  Vec3 entry_m, axis;
};

/// Random paths from the skin to places near the targets, or near the profile's parts if it has no target:
/// the same for a seed. Each is in the patient for at least 2 mm. Fewer than `count` if the field is hard to
/// hit.
std::vector<AnatomyPath> randomPaths(const Field& field, const pb::Profile& profile, std::size_t count,
                                     std::uint64_t seed);

enum class AnatomySteps : std::uint8_t {
  kFixed,   ///< the whole field, asked at each step
  kSphere,  ///< `march`; the step is its least one
  kEngine,  ///< the path that the engine steps on in an insertion (findPath), up to its first bone
};

/// A way to get the stack of a path.
struct AnatomyMethod {
  AnatomySteps steps = AnatomySteps::kSphere;
  double step_m = 0;
  friend bool operator==(const AnatomyMethod&, const AnatomyMethod&) = default;
  [[nodiscard]] const char* name() const {
    return steps == AnatomySteps::kSphere  ? "sphere steps"
           : steps == AnatomySteps::kFixed ? "fixed steps"
                                           : "engine's path";
  }
  /// `body`: of the same field, compiled.
  [[nodiscard]] LayerStack stackOf(const SceneModel& body, const Field& field, const AnatomyPath& path,
                                   double reach_m, double min_layer_m) const;
};

/// A row of the study: one method over all paths.
struct AnatomyRow {
  AnatomyMethod method;
  double boundary_p50_mm = 0, boundary_p99_mm = 0,
         boundary_max_mm = 0;                    ///< of the boundaries that both stacks have
  double missed_percent = 0, extra_percent = 0;  ///< of the reference's boundaries
  double force_rms_N = 0;                        ///< over all ticks of all paths
  double path_rms_p99_N = 0, force_max_N = 0;
  double march_p50_us = 0, march_p99_us = 0;  ///< of this thread's processor time
};

struct AnatomyReport {
  std::string profile;
  std::size_t paths = 0, numbers = 0;
  double layers_per_path = 0;
  std::vector<AnatomyRow> rows;
  /// Processor time of a tick with the cap on, pressed on the skin where paths enter; 0 without PALPATION.
  double palpation_p50_us = 0, palpation_p99_us = 0;
  std::uint64_t hash = 0;  ///< over the stacks of "sphere steps" of 0.1 mm: the same on every machine
};

/// A plane section, row by row from its lower left corner.
struct AnatomySection {
  char across = 'x', up = 'z';  ///< the axes of L in the picture
  double at_m = 0;              ///< the third coordinate
  double left_m = 0, bottom_m = 0, pixel_m = 0;
  std::size_t columns = 0, rows = 0;
  std::vector<StructureIndex> pixels;
};

/// The section through the middle of what needles aim at, perpendicular to an axis of L ('x', 'y' or 'z').
AnatomySection anatomySection(const Field& field, const pb::Profile& profile, char normal);

struct AnatomyStudyOptions {
  std::size_t paths = 1000;
  std::uint64_t seed = 1;
};

/// Runs the study; `progress` gets the share done, 0 to 1. Errors: kInvalidInput if the profile has no
/// volume, or hardly a path can be found.
Result<AnatomyReport> anatomyStudy(const pb::Profile& profile, const AnatomyStudyOptions& options,
                                   const std::function<void(double)>& progress);

}  // namespace needlelab
