/// A hard case (tests/stability/README.md) and the results of its runs; good and bad samples from a device.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "client/device/hand/hand_plan.h"
#include "client/sim/stability/case_file.h"
#include "client/sim/stability/gestures/passivity_gesture.h"
#include "client/sim/stability/gestures/passivity_observer.h"
#include "client/sim/stability/loop/measures.h"
#include "client/sim/stability/loop/plant.h"
#include "common/haptics/axial_model.h"
#include "common/haptics/gate/force_gate.h"

namespace needlelab {

/// Tick rate of prescribed motions and of samples before the gate, unless a case sets its own.
inline constexpr double kMotionRate_hz = 1000;

/// The device's report in one tick.
struct DeviceSample {
  TipSample tip;
  bool fresh = true;               ///< false: no report
  bool acknowledge = false;        ///< a person acknowledges the fault in this tick
  std::int64_t elapsed_ticks = 1;  ///< periods since the previous sample, by the loop's clock
};

/// The other quaternion of the same rotation.
inline Quat otherSign(Quat q) {
  return {-q.x, -q.y, -q.z, -q.w};
}

struct GatedTick {
  DeviceSample sample;
  StepReport report;  ///< of the last stepped tick
  Wrench out_W;       ///< to the device
  Fault fault = Fault::kNone;
  double depth_m = 0;
};

/// A source behind the gate, as in the haptic loop. `with_gate` false passes the source's wrench to the
/// device unchanged and steps every sample. A plane's normal must have unit length.
class GatedSource {
 public:
  GatedSource(std::unique_ptr<ForceSource> source, const Limb& limb, bool with_gate)
      : source_(std::move(source)), limb_(limb), with_gate_(with_gate) {}
  GatedTick next(const DeviceSample& sample) {
    const bool admitted = gate_.admit(sample.tip, sample.fresh, 0.0, sample.elapsed_ticks);
    Wrench wanted;
    if (with_gate_ ? admitted : sample.fresh) {
      source_->step(sample.tip, report_);
      wanted = report_.wrench_W;
    } else if (!with_gate_) {
      wanted = report_.wrench_W;  // no new sample: the device keeps the last wrench
    }
    const double depth_m = signedDepth(limb_, sample.tip.p_WT_m);
    gate_.noteOutside(depth_m <= 0);
    if (sample.acknowledge) gate_.acknowledge();
    const Wrench guarded = gate_.guard(wanted).wrench();
    return {sample, report_, with_gate_ ? guarded : wanted, with_gate_ ? gate_.fault() : Fault::kNone,
            depth_m};
  }

 private:
  std::unique_ptr<ForceSource> source_;
  Limb limb_;
  ForceGate gate_{DeviceLimits{}, kMotionRate_hz};
  bool with_gate_;
  StepReport report_;
};

/// Built piece by piece; starts upright, 5 mm outside, at kMotionRate_hz.
class DeviceScript {
 public:
  DeviceScript() { now_.tip = {{0, 0, 0.005}, orientationAlong({0, 0, -1})}; }
  DeviceScript& rest(double seconds) {
    for (std::size_t k = ticksOf(seconds); k > 0; --k) samples_.push_back(now_);
    return *this;
  }
  DeviceScript& goTo(double depth_m, double speed_mps) {
    const double from = now_.tip.p_WT_m.z, way = -depth_m - from;
    const std::size_t ticks = ticksOf(std::abs(way) / speed_mps);
    for (std::size_t k = 1; k <= ticks; ++k) {
      now_.tip.p_WT_m.z = from + way * static_cast<double>(k) / static_cast<double>(ticks);
      samples_.push_back(now_);
    }
    return *this;
  }
  /// Changes the device's reports for a while: `change(sample, k)`, k from 0.
  template <typename Change>
  DeviceScript& with(double seconds, const Change& change) {
    for (std::size_t k = 0; k < ticksOf(seconds); ++k) {
      samples_.push_back(now_);
      change(samples_.back(), k);
    }
    return *this;
  }
  /// A person acknowledges the fault in the last tick.
  DeviceScript& acknowledge() {
    samples_.back().acknowledge = true;
    return *this;
  }
  [[nodiscard]] std::size_t ticks() const { return samples_.size(); }
  [[nodiscard]] const std::vector<DeviceSample>& samples() const { return samples_; }

 private:
  static std::size_t ticksOf(double seconds) {
    return static_cast<std::size_t>(seconds * kMotionRate_hz + 0.5);
  }
  DeviceSample now_;
  std::vector<DeviceSample> samples_;
};

enum class Verdict {
  kStable,         ///< within the limit and not growing
  kChatters,       ///< bounded, but over the limit
  kDiverges,       ///< grows, is not finite, or only the gate limits it
  kNotApplicable,  ///< the case does not apply to this model
};
/// "stable", "chatters", "diverges"; "" where not applicable.
std::string_view verdictText(Verdict verdict);

/// How many of a case's neighbours, itself included, are stable.
struct NeighbourCount {
  std::size_t stable = 0, all = 0;
  [[nodiscard]] double share() const {
    return all > 0 ? static_cast<double>(stable) / static_cast<double>(all) : 0;
  }
};
/// "47 % 30-64": the share that is stable, with its 95 % interval (wilsonInterval).
std::string neighboursText(const NeighbourCount& count);

/// One row of `needlelab-sim stability`. Empty numbers are null in JSON.
struct CaseRow {
  std::string case_name, title;  ///< as in cases.json; the title is for people
  AxialModel model = AxialModel::kEnhancedTrackingWall;
  bool applicable = false;
  bool finite = false;
  std::optional<double> max_force_N;
  std::optional<double> max_unexplained_step_N;
  std::optional<double> chatter_N;  ///< RMS of the force in 50-500 Hz over the case's window
  std::optional<double> energy_J;   ///< net energy given to the hand
  /// Closed loops only, minimum over the runs: theoretical limit relative to the stiffness, with the case's
  /// hand (coupled stability) and with the device's own damping alone (passivity); see LoopMargins.
  std::optional<double> coupled_margin, passive_margin;
  std::optional<double> grip_energy_J;  ///< closed loops only, maximum over the runs; see
                                        ///< greatestGripEnergy_J
  /// If the case tests it: the same energy with the passivity control, and the largest force that the control
  /// removed (then grip_energy_J is without it).
  std::optional<double> controlled_energy_J, distortion_N;
  /// The greatest energy given to the hand in any second of the case's window (greatestInASecond_J), if it is
  /// long enough; and the swing of the force in the last second of a hold, without its
  /// creep.
  std::optional<double> second_energy_J, hold_swing_N;
  /// If the case is a neighbourhood: then `measured` is the share that is not stable.
  std::optional<NeighbourCount> neighbours;
  std::optional<double> measured;  ///< the judged value, in the unit of `quantity`
  std::optional<double> limit;
  std::string quantity;  ///< e.g. "peak-to-peak in the hold [N]"
  bool passed = false;
  Verdict verdict = Verdict::kNotApplicable;
  std::string note;  ///< for people; may be empty
};

/// Resistance (force against the way in, before the gate) of a run, for a picture.
struct CaseTrace {
  std::vector<double> time_s, force_N;
  double from_s = 0, to_s = 0;  ///< the case's window
};

struct CaseOutcome {
  CaseRow row;
  CaseTrace trace = {};  ///< closed loops only, of the run with the worst measure
};

/// One tick: the wrench rendered at the handle for the wanted one.
using WrenchLimiter = std::function<Wrench(const TipSample& tip, const Wrench& wanted)>;
/// Creates one in its initial state.
using WrenchLimiterFactory = std::function<WrenchLimiter(double rate_hz)>;

/// What a test disables to see a case fail; by default nothing.
struct CaseControl {
  bool gate = true;                  ///< bad samples meet the gate
  bool uses_measured_delay = true;   ///< false: the passivity control assumes one tick of delay and no lag
  std::optional<double> capacity_J;  ///< of the passivity control's tank; empty: the shipped one
  WrenchLimiterFactory limiter;      ///< replaces the gate where a hand leans on a tool; empty: the gate
};

struct CaseSettings {
  const CaseFile& file;
  bool long_form = false;
  CaseControl control = {};
};

/// Input and output of one tick of a prescribed motion.
struct MotionTick {
  TipSample tip;
  StepReport report;
  double slant = 1;  ///< c
};

/// A motion that follows its path regardless of the force.
struct MotionRun {
  double axial_stiffness_N_per_m = 0;
  std::vector<MotionTick> ticks;
};

/// Whether only the gate or the cap on the sum limits it within the window, or the gate has faulted.
bool heldIn(const PlantRun& run, TimeWindow window);
/// Whether it does not come to rest within the window, or only the gate or the cap on the sum limits it.
bool growsIn(const PlantRun& run, TimeWindow window);
/// Peak-to-peak resistance in the window.
double peakToPeakIn(const PlantRun& run, TimeWindow window);

/// The quantity that a case judges in a run's window.
using CaseMeasure = std::function<double(const PlantRun& run, TimeWindow window)>;

/// One case with one model: its entry, scene and plant, and the row with the worst of each number over all
/// runs. Errors of a run become the entry's.
class Trial : public CaseEntry {
 public:
  Trial(const CaseSettings& of, std::string_view name, AxialModel with, ForceSourceFactory from);

  /// Marks the case as not applicable to this model.
  Status notApplicable(std::string note);
  /// Sets what the closed-loop runs are judged by.
  void judges(std::string quantity, double limit);
  /// The same with the measured value.
  void judge(std::string quantity, double measured, double limit, std::string note = {});
  /// A condition besides the one on `measured`; `what`, if given, goes into the note if it fails.
  void require(bool holds, std::string_view what = {});

  /// Runs a closed loop with the scene and the plant.
  Result<PlantRun> loop(const HandPlan& plan);
  /// Adds a closed-loop run to the row: compares `measured` with the limit, and checks the window for chatter
  /// and growth.
  void add(const PlantRun& run, TimeWindow window, double measured) {
    add(run, window, measured, growsIn(run, window));
  }
  /// The same for runs that are expected to swing: the caller decides whether a run grows.
  void add(const PlantRun& run, TimeWindow window, double measured, bool run_grows);
  /// Runs the entry's path with a change, and adds `measure` over its window.
  Status onPath(const CaseMeasure& measure, const PathChange& change = {});

  /// Adds a prescribed motion to the row, with the passivity observer.
  Result<MotionRun> move(const std::vector<TipSample>& samples, double rate_hz = kMotionRate_hz);
  /// Passes device samples through the gate at 1 kHz; adds them to the row unless `in_row` is false.
  Result<std::vector<GatedTick>> gated(const std::vector<DeviceSample>& samples, bool in_row = true);

  CaseRow& row() { return outcome.row; }
  /// Whether the model stops the needle when the force is too small. Cases and conditions about stops apply
  /// only then; the other models' force depends on depth alone.
  [[nodiscard]] bool hasStop() const;

  CaseSettings settings;
  AxialModel model;
  ForceSourceFactory source;
  SceneSpec wall;   ///< the entry's scene
  SceneSpec scene;  ///< the same, as rendered by the model: likeForLike
  PlantOptions plant;
  CaseOutcome outcome;
  bool growing = false;
};

struct StabilityCase {
  std::string name;  ///< as in cases.json; tests/stability/README.md describes it
  std::function<Status(Trial&)> run;
  bool axial = true;  ///< applies to all axial models; otherwise only to the wall
  bool scene = true;  ///< its entry has a scene; otherwise it draws or borrows one
};

std::vector<StabilityCase> holdCases();
std::vector<StabilityCase> motionCases();  ///< including gateCases()
std::vector<StabilityCase> gateCases();
std::vector<StabilityCase> scanCases();
std::vector<StabilityCase> loadCases();
std::vector<StabilityCase> gestureCases();
std::vector<StabilityCase> deviceCases();
std::vector<StabilityCase> lineCases();
/// All of them: holds, prescribed motions, stiffness and missing ticks, loads, random gestures and the
/// passivity control, errors of a device or its clock, and the needle's line.
std::vector<StabilityCase> allCases();

/// Runs a case; returns a not-applicable row if it does not apply to `model`. Errors: kInvalidInput if the
/// case's entry in the file is invalid.
Result<CaseOutcome> runCase(const StabilityCase& hard_case, const CaseSettings& settings, AxialModel model,
                            const ForceSourceFactory& source);

inline constexpr double kAnyForce_N = 0.01;  ///< smaller forces count as zero

/// Creates a source for `scene` and runs it to the plan's end.
Result<PlantRun> runScene(const ForceSourceFactory& source, const SceneSpec& scene, const HandPlan& plan,
                          const PlantOptions& options);
/// Steps a new source through the samples. Errors: those of the source.
Result<MotionRun> runMotion(const ForceSourceFactory& source, const SceneSpec& scene,
                            const std::vector<TipSample>& samples, double rate_hz);
/// The run's record from the passivity observer.
PassivityRecord observed(const MotionRun& run);

/// Whether the row has a force step that no spring explains and a hand may notice (kNoticeableStep_N); empty
/// if steps were not measured.
std::optional<bool> stepIsNoticeable(const CaseRow& row);

/// finite, max force, unexplained step, chatter and the energy in a second over the window, energy given to
/// the hand over the whole run, margins, and energy at the grip.
CaseRow measuredRow(const PlantRun& run, TimeWindow window);
/// finite, max force, unexplained step and the judged energy.
CaseRow rowOf(const PassivityRecord& record);

/// Keeps the worse of both for each number, for cases with several runs: the larger energy, the smaller
/// margin.
void worsen(CaseRow& row, const CaseRow& other);

/// Resistance over the window.
CaseTrace traceOf(const PlantRun& run, TimeWindow window);

/// One object per row.
nlohmann::ordered_json rowsJson(const std::vector<CaseRow>& rows);

/// One line per case, one column per model: the measured value, marked if it chatters (~) or diverges (!);
/// of a neighbourhood its share; below it the notes, the margins of closed loops, and force steps that a hand
/// may notice. `rows`: case by case, each with the same models.
std::string rowsText(const std::vector<CaseRow>& rows);

/// Short names of models for column heads: "wall", "wall 2018", "direct", …
std::string_view shortName(AxialModel model);
/// What a row's measured value is held against: the limit, or the least share of a neighbourhood, "90 %".
std::string limitText(const CaseRow& row);
/// A number with three significant digits; "0" below 1e-9, "-" if missing.
std::string shortNumber(std::optional<double> value);

/// The names of all cases, in order.
std::vector<std::string> caseNames(const std::vector<CaseRow>& rows);
/// The models of the rows, in order.
std::vector<AxialModel> modelsOf(const std::vector<CaseRow>& rows);
const CaseRow* rowOf(const std::vector<CaseRow>& rows, const std::string& case_name, AxialModel model);

/// One sentence: in how many cases the wall is stable, and which models chatter or diverge most.
std::string findingOf(const std::vector<CaseRow>& rows);

}  // namespace needlelab
