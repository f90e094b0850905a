/// A hard case (tests/stability/README.md) and the results of its runs.
#pragma once

#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "client/sim/stability/case_file.h"
#include "client/sim/stability/gated_run.h"
#include "client/sim/stability/measures.h"
#include "client/sim/stability/passivity_gesture.h"
#include "client/sim/stability/passivity_observer.h"
#include "client/sim/stability/plant.h"
#include "common/haptics/axial_model.h"

namespace needlelab {

enum class Verdict {
  kStable,         ///< within the limit and not growing
  kChatters,       ///< bounded, but over the limit
  kDiverges,       ///< grows, is not finite, or only the gate holds it
  kNotApplicable,  ///< the case says nothing about this model
};
/// "stable", "chatters", "diverges"; "" where not applicable.
std::string_view verdictText(Verdict verdict);

/// One row of `needlelab-sim stability`. Empty numbers are null in JSON.
struct CaseRow {
  std::string case_name;
  AxialModel model = AxialModel::kEnhancedTrackingWall;
  bool applicable = false;
  bool finite = false;
  std::optional<double> max_force_N;
  std::optional<double> max_unexplained_step_N;
  std::optional<double> chatter_N;  ///< RMS of the force in 50-500 Hz over the case's window
  std::optional<double> energy_J;   ///< given to the hand, net
  /// Closed loops only, the least of the runs: what theory allows over the stiffness, with the hand of the
  /// case (coupled stability) and with the device's own damping alone (passivity), as LoopMargins.
  std::optional<double> coupled_margin, passive_margin;
  std::optional<double> grip_energy_J;  ///< closed loops only, the greatest: as greatestGripEnergy_J
  /// Where the case has it: the same energy with the passivity control, and the greatest force that this took
  /// off (grip_energy_J is then that without it).
  std::optional<double> controlled_energy_J, distortion_N;
  std::optional<double> measured;  ///< the value that the case judges, in the unit of `quantity`
  std::optional<double> limit;
  std::string quantity;  ///< e.g. "peak-to-peak in the hold [N]"
  bool passed = false;
  Verdict verdict = Verdict::kNotApplicable;
  std::string note;  ///< for a person; may be empty
};

/// The resistance (force against the way in, before the gate) of a run, for a picture.
struct CaseTrace {
  std::vector<double> time_s, force_N;
  double from_s = 0, to_s = 0;  ///< the case's window
};

struct CaseOutcome {
  CaseRow row;
  CaseTrace trace = {};  ///< closed loops only, of the run that measured worst
};

/// One tick: the wrench at the handle that is rendered for the wanted one.
using WrenchLimiter = std::function<Wrench(const TipSample& tip, const Wrench& wanted)>;
/// A new one, as before the first tick.
using WrenchLimiterFactory = std::function<WrenchLimiter(double rate_hz)>;

/// What a test takes away to see a case fail; as shipped by default.
struct CaseControl {
  bool gate = true;              ///< bad samples meet the gate
  bool told_as_measured = true;  ///< false: the passivity control is told one tick of delay and no lag
  WrenchLimiterFactory limiter;  ///< in the gate's place where a hand leans on a tool; none: the gate
};

struct CaseSettings {
  const CaseFile& file;
  bool long_form = false;
  CaseControl control = {};
};

/// All that one tick of a prescribed motion saw and gave.
struct MotionTick {
  TipSample tip;
  StepReport report;
  double slant = 1;  ///< c
};

/// A motion that follows its path whatever the force.
struct MotionRun {
  double rate_hz = 1000;
  double axial_stiffness_N_per_m = 0;
  std::vector<MotionTick> ticks;
};

/// Only the gate or the cap of the sum holds it within the window, or the gate has given up.
bool heldIn(const PlantRun& run, TimeWindow window);
/// Does not come to rest within the window, or only the gate or the cap of the sum holds it.
bool growsIn(const PlantRun& run, TimeWindow window);
/// Peak-to-peak of the resistance in the window.
double peakToPeakIn(const PlantRun& run, TimeWindow window);

/// What a case judges of a run in a window.
using CaseMeasure = std::function<double(const PlantRun& run, TimeWindow window)>;

/// One case with one model: its entry, scene and plant, and the row of all its runs, which gets the worst of
/// each number. A run's errors are the entry's, too.
class Trial : public CaseEntry {
 public:
  Trial(const CaseSettings& of, std::string_view name, AxialModel with, ForceSourceFactory from);

  /// The case says nothing about this model.
  Status saysNothing(std::string note);
  /// What the runs of a closed loop are judged by.
  void judges(std::string quantity, double limit);
  /// The same with what was measured.
  void judge(std::string quantity, double measured, double limit, std::string note = {});
  /// Another condition than the one on `measured`; `what`, where given, is told where it does not hold.
  void require(bool holds, std::string_view what = {});

  /// A closed loop with the scene and the plant.
  Result<PlantRun> loop(const HandPlan& plan);
  /// A closed loop's run in the row; `measured` is compared with the limit, chatter and growth are looked for
  /// in the window.
  void add(const PlantRun& run, TimeWindow window, double measured) {
    add(run, window, measured, growsIn(run, window));
  }
  /// The same for runs that are expected to swing: the caller says whether a run grows.
  void add(const PlantRun& run, TimeWindow window, double measured, bool run_grows);
  /// Runs the entry's path, changed, and adds what `measure` says of its window.
  Status onPath(const CaseMeasure& measure, const PathChange& change = {});

  /// A prescribed motion in the row: under the passivity observer.
  Result<MotionRun> move(const std::vector<TipSample>& samples, double rate_hz = 1000);
  /// Samples of a device before the gate, at 1 kHz; in the row but for `in_row` false.
  Result<std::vector<GatedTick>> gated(const std::vector<DeviceSample>& samples, bool in_row = true);

  CaseRow& row() { return outcome.row; }
  /// The model stops the needle where the force does not suffice: cases and conditions about a stop are for
  /// these only. The other models' force depends on the depth alone.
  [[nodiscard]] bool hasStop() const;

  CaseSettings settings;
  AxialModel model;
  ForceSourceFactory source;
  SceneSpec scene;  ///< rendered by the model
  PlantOptions plant;
  BandFilter band;
  CaseOutcome outcome;
  bool growing = false;
};

struct StabilityCase {
  std::string name;  ///< as in cases.json; tests/stability/README.md says what happens
  std::function<Status(Trial&)> run;
  bool axial = true;  ///< says something about every axial model; else about the wall only
  bool scene = true;  ///< its entry has a scene; else it draws or borrows one
};

std::vector<StabilityCase> holdCases();
std::vector<StabilityCase> motionCases();  ///< gateCases(), too
std::vector<StabilityCase> gateCases();
std::vector<StabilityCase> scanCases();
std::vector<StabilityCase> loadCases();
std::vector<StabilityCase> gestureCases();
std::vector<StabilityCase> deviceCases();
std::vector<StabilityCase> lineCases();
/// All of them: holds, prescribed motions, stiffness and missing ticks, loads, random gestures and the
/// passivity control, what a device or its clock does wrong, and the needle's line.
std::vector<StabilityCase> allCases();

/// Runs a case; a row that is not applicable where the case says nothing about `model`. Errors: kInvalidInput
/// when the case's entry in the file does not fit.
Result<CaseOutcome> runCase(const StabilityCase& hard_case, const CaseSettings& settings, AxialModel model,
                            const ForceSourceFactory& source);

inline constexpr double kAnyForce_N = 0.01;  ///< less is no force

/// Into the tissue, in W: the paths of cases.json run along it.
inline constexpr Vec3 kInward_W{0, 0, -1};

/// Makes a source for `scene` and runs it to the plan's end.
Result<PlantRun> runScene(const ForceSourceFactory& source, const SceneSpec& scene, const HandPlan& plan,
                          const PlantOptions& options);
/// Steps a new source over the samples. Errors: those of the source.
Result<MotionRun> runMotion(const ForceSourceFactory& source, const SceneSpec& scene,
                            const std::vector<TipSample>& samples, double rate_hz);
/// The run under the passivity observer.
PassivityRecord observed(const MotionRun& run);

/// A force step in the row that no spring explains and that a hand may notice (kNoticeableStep_N); empty
/// where steps were not measured.
std::optional<bool> stepIsNoticeable(const CaseRow& row);

/// finite, max force, unexplained step, chatter over the window, energy given to the hand over the whole run,
/// margins and energy at the grip.
CaseRow measuredRow(const PlantRun& run, TimeWindow window, const BandFilter& band);
/// finite, max force, unexplained step and the judged energy.
CaseRow rowOf(const PassivityRecord& record);

/// The worse of both in each number, for cases of several runs; energies: the greater, margins: the less.
void worsen(CaseRow& row, const CaseRow& other);

/// The resistance over the window.
CaseTrace traceOf(const PlantRun& run, TimeWindow window);

/// An object a row.
nlohmann::ordered_json rowsJson(const std::vector<CaseRow>& rows);

/// One line a case, one column a model: the measured value, marked where it chatters (~) or diverges (!);
/// below it each case's quantity, the notes, the margins of the closed loops, the force steps that a hand may
/// notice, and in which cases another model does no worse than the enhanced tracking wall. `rows` case by
/// case, each with the same models.
std::string rowsText(const std::vector<CaseRow>& rows);

/// Short names of models for column heads: "wall", "wall 2018", "direct", …
std::string_view shortName(AxialModel model);
/// A number with three significant digits; "0" below 1e-9, "-" where there is none.
std::string shortNumber(std::optional<double> value);

/// The rows of one case, in order; and all cases' names in order.
std::vector<std::string> caseNames(const std::vector<CaseRow>& rows);
/// The models of the rows, in order.
std::vector<AxialModel> modelsOf(const std::vector<CaseRow>& rows);
const CaseRow* rowOf(const std::vector<CaseRow>& rows, const std::string& case_name, AxialModel model);

/// One sentence: in how many cases the wall is stable, and which models chatter or diverge most.
std::string findingOf(const std::vector<CaseRow>& rows);

}  // namespace needlelab
