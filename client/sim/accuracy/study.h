/// The comparators of the accuracy report: each is a function that returns rows; study.cpp lists them. What
/// they share: models at equal stiffness, the cost of a tick.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "client/sim/accuracy/closed_form.h"
#include "client/sim/accuracy/row.h"
#include "common/base/result.h"
#include "common/fem/needle_study.h"
#include "common/haptics/engine.h"
#include "common/haptics/models/like_for_like.h"
#include "common/haptics/scene_spec.h"

namespace needlelab {

struct AccuracyOptions {
  bool long_form = false;      ///< more gestures, finer meshes: minutes
  std::filesystem::path data;  ///< folder of the recordings; empty if missing
};

/// Called now and then with the current work and the finished share of the comparator (0-1).
using AccuracyProgress = std::function<void(std::string_view doing, double share)>;

/// One comparator. Returns rows in display order; if its data are missing, no rows and a remark in `notes`
/// that names the setting. Deterministic. Thread: one.
struct AccuracyStudy {
  Comparator comparator;
  Result<AccuracyRows> (*run)(const AccuracyOptions& options, const AccuracyProgress& progress,
                              std::vector<std::string>& notes);
};
const std::vector<AccuracyStudy>& accuracyStudies();

/// All models with a quasi-static formula (closed_form.h), at 250 Hz to 4 kHz and with encoder steps of 1 to
/// 50 µm; STATISTICAL by its distribution.
Result<AccuracyRows> verificationRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                                      std::vector<std::string>& notes);

/// FEM on increasingly fine meshes for several numbers of stations, at the same E, compared with the finest.
/// Its preparation is timed once for each.
Result<AccuracyRows> refinementRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                                    std::vector<std::string>& notes);

/// All models at equal stiffness along recorded hands.
Result<AccuracyRows> replayRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                                std::vector<std::string>& notes);

inline constexpr double kStationRate_hz = 1000, kStationEncoder_m = 1e-5;
/// Compared numbers of FEM stations: the tick's cost depends on them, not on the mesh.
inline constexpr int kStationCounts[] = {15, 30, 60, 128};

/// A scene rendered by one of the models.
struct StudyModel {
  AxialModel model = AxialModel::kEnhancedTrackingWall;
  std::string variant;  ///< empty for the default
  SceneSpec spec;       ///< like for like; FEM: with its compliance
  int stations = 0;     ///< of FEM
};

/// The paper's six layers.
Result<SceneSpec> studyScene();

/// All axial models at the stiffness of the scene's walls (likeForLike, femLikeForLike); VOIGT also with a
/// velocity over an adaptive window; FEM with each number of kStationCounts on a mesh of about `fem_nodes`.
/// Errors: as femLikeForLike.
Result<std::vector<StudyModel>> studyModels(const SceneSpec& scene, int fem_nodes = 3000);

/// Force along the trajectory: sum of cutting, attracted, friction and puncture.
double axialForce_N(const StepReport& report);

/// Cost of a model, the same in all comparators.
struct ModelCost {
  std::string model, variant;
  int stations = 0;
  std::optional<LoopTimes> time;
  std::optional<double> instructions;
  double margin = 0;
};

/// Times a tick in the station's own loop (ServoLoop with the simulated device and hand, at 1 kHz and normal
/// priority), in three rounds of `seconds` in turns: p50 and p99.9 of its histogram of tool, gate and engine,
/// each the median of the rounds, printed as equal. Margin: `b/(T(½ + delay))/K`, with the device's own
/// damping and the model's stiffness along the needle (FORCE_MODEL.md, "Stiffnesses"). Thread: starts one.
/// Errors: those of `compile`; kFailed if the loop ended early.
Result<std::vector<ModelCost>> measureCosts(double seconds, const AccuracyProgress& progress);

/// From the fastest on: models whose ranges (low_ns to high_ns) all overlap each other get the whole range,
/// and the median of their p50_ns: these times do not tell them apart.
void printAsEqual(std::vector<ModelCost>& costs);

/// Counts the instructions of a tick of each model over one gesture. `command` must be a program that calls
/// `stepForCounting`. Errors: as countStepInstructions.
Status countInstructions(const std::vector<std::string>& command, std::vector<ModelCost>& costs);
/// Steps every model through the gesture, and marks the end of each (tick_cost.h).
Status stepForCounting();

/// Adds each model's cost to its rows at the station's rate.
void addCosts(const std::vector<ModelCost>& costs, AccuracyRows& rows);

// --- verification: the engine beside a closed form along one gesture

/// Seeded gestures of 5 to 20 mm/s that turn between 24.5 and 27.5 mm.
std::vector<TurnGesture> turnGestures(int count);

/// The moments in which the formula jumps along the gesture, in s, ascending; 0 outside of the tissue.
std::vector<double> jumpsOf(const ClosedForm& form, const TurnGesture& gesture);

/// What the engine misses of a formula along a gesture.
struct FormulaError {
  /// In tissue, farther from each jump than two ticks and the time of half an encoder step.
  ForceError between;
  /// The greatest time from a jump until the engine is nearer to the formula than to the force before the
  /// jump; until the end if it never is. Empty if the formula has no jump.
  std::optional<double> delay_s;
};
/// The engine with the scene of `rendered` relative to the formula of `right`. Each tick's force is held
/// until the next; the formula continues in between. The depth is read in steps of `encoder_m` (0: exact).
/// Errors: those of `compile`.
Result<FormulaError> errorOf(const ClosedForm& rendered, const ClosedForm& right, const TurnGesture& gesture,
                             double rate_hz, double encoder_m);

// --- refinement: how far a mesh is from its limit

/// The paper's six layers as FEM with a tip as stiff as the scene's walls (femLikeForLike): all meshes have
/// this E. Errors: those of femLikeForLike.
Result<FemScene> femScene();

/// One row for each mesh except the last, which is the reference. `young_factor`: as in FemScene.
AccuracyRows rowsOf(const std::vector<MeshRow>& meshes, double young_factor);

// --- replay: a recorded hand as a smooth path that can be sampled at any rate

inline constexpr int kReplayFactor = 16;  ///< the reference's rate relative to the station's

/// A hand's path at kReplayFactor times the station's rate, and the ball of tissue that it enters.
struct RecordedHand {
  std::string name;
  std::vector<Vec3> path_m;
  SphereLimb limb;
  Quat needle;  ///< toward the farthest point
};

/// The hand-moved Virtuose recordings of `data`/virtuose, ordered by name; missing recordings are omitted.
/// Positions are means over 10 ms, because receive times jitter and half of the rows repeat. Errors: those of
/// readPoseTrack.
Result<std::vector<RecordedHand>> recordedHands(const std::filesystem::path& data);

/// Error of the station's loop, with its force held between ticks and its encoder steps, relative to the same
/// scene at kReplayFactor times the rate without them, while the needle is in tissue. Errors: those of
/// `compile`.
Result<ForceError> replayError(SceneSpec scene, const RecordedHand& hand);

}  // namespace needlelab
