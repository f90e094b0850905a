/// A hard case (tests/stability/README.md) and the results of its runs.
#pragma once

#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "client/sim/stability/case_file.h"
#include "client/sim/stability/measures.h"
#include "client/sim/stability/plant.h"
#include "common/haptics/axial_model.h"

namespace needlelab {

/// True if the model stops the needle where the force does not suffice: cases and conditions about a stop are
/// for these only. The other models' force depends on the depth alone.
bool hasStop(AxialModel model);

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

/// A curve for a picture.
struct CaseTrace {
  std::string label;
  std::vector<double> time_s, force_N;
  double from_s = 0, to_s = 0;  ///< the case's window; both 0 where it has none
};

/// A file that a case gives besides its row, e.g. a counter-example.
struct CaseAttachment {
  std::string name, text;
};

struct CaseOutcome {
  CaseRow row;
  std::vector<CaseTrace> traces = {};
  std::vector<CaseAttachment> files = {};
};

struct CaseSettings {
  const CaseFile& file;
  bool long_form = false;
};

/// Runs one case with one model. Errors: kInvalidInput when the case's entry in the file does not fit.
using CaseRun =
    std::function<Result<CaseOutcome>(const CaseSettings&, AxialModel, const ForceSourceFactory&)>;

struct StabilityCase {
  std::string name;         ///< as in cases.json
  std::string summary;      ///< its subject, a short sentence
  bool axial = false;       ///< says something about every axial model; else about the wall only
  bool prescribed = false;  ///< motion prescribed (° in tests/stability/README.md), not a closed loop
  CaseRun run;
};

std::vector<StabilityCase> holdCases();
std::vector<StabilityCase> motionCases();
std::vector<StabilityCase> scanCases();
std::vector<StabilityCase> loadCases();
std::vector<StabilityCase> deviceCases();
std::vector<StabilityCase> passivityCases();
std::vector<StabilityCase> lineCases();
std::vector<StabilityCase> lateCases();
/// All of them: holds, prescribed motions, stiffness and missing ticks, then releases under load and the
/// lever, what a device or its clock does wrong, the passivity control, the needle's line, and late forces.
std::vector<StabilityCase> allCases();

/// Runs a case; a row that is not applicable where the case says nothing about `model`.
Result<CaseOutcome> runCase(const StabilityCase& hard_case, const CaseSettings& settings, AxialModel model,
                            const ForceSourceFactory& source);

/// Sets `passed` and `verdict` from `measured ≤ limit`, `finite` and whether it grows.
void judge(CaseRow& row, bool growing);

/// Into the tissue, in W: the paths of cases.json run along it.
inline constexpr Vec3 kInward_W{0, 0, -1};

/// Makes a source for `scene` and runs it to the plan's end.
Result<PlantRun> runScene(const ForceSourceFactory& source, const SceneSpec& scene, const HandPlan& plan,
                          const PlantOptions& options);

/// A force step in the row that no spring explains and that a hand may notice (kNoticeableStep_N); empty
/// where steps were not measured.
std::optional<bool> stepIsNoticeable(const CaseRow& row);

/// finite, max force, unexplained step, chatter over the window, energy given to the hand over the whole run,
/// margins and energy at the grip.
CaseRow measuredRow(const PlantRun& run, TimeWindow window, const BandFilter& band);

/// The worse of both in each number, for cases of several runs; energies: the greater, margins: the less.
void worsen(CaseRow& row, const CaseRow& other);

/// Only the gate or the cap of the sum holds it within the window, or the gate has given up.
bool heldIn(const PlantRun& run, TimeWindow window);
/// Does not come to rest within the window, or only the gate or the cap of the sum holds it.
bool growsIn(const PlantRun& run, TimeWindow window);

/// The resistance (force against the way in, before the gate) over the whole run.
CaseTrace traceOf(const PlantRun& run, std::string label);

/// Puts the runs of one case together: the row gets the worst of each number, the curve is of the run that
/// measured worst.
class CaseTally {
 public:
  /// `quantity`: the measured quantity, with its unit; `band`: as of CaseEntry::chatterFilter.
  CaseTally(std::string quantity, double limit, const BandFilter& band);
  /// `measured` is compared with the limit; chatter and growth are looked for in the window.
  void add(const PlantRun& run, TimeWindow window, double measured, const std::string& label) {
    add(run, window, measured, label, growsIn(run, window));
  }
  /// As above, for runs that are expected to swing: the caller decides whether a run grows.
  void add(const PlantRun& run, TimeWindow window, double measured, const std::string& label, bool growing);
  /// The row, judged; at least one run was added.
  [[nodiscard]] CaseOutcome finish();

 private:
  CaseOutcome outcome_;
  BandFilter band_;
  bool growing_ = false;
};

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
const CaseRow* rowOf(const std::vector<CaseRow>& rows, const std::string& case_name, AxialModel model);

/// One sentence: in how many cases the wall is stable, and which models chatter or diverge most.
std::string findingOf(const std::vector<CaseRow>& rows);

}  // namespace needlelab
