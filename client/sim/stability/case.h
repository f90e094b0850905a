/// A hard case of DESIGN §10: what it is, and what running it gives.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "client/sim/stability/case_file.h"
#include "client/sim/stability/force_source.h"
#include "common/haptics/axial_model.h"

namespace needlelab {

/// Whether the model stops the needle where the force does not suffice; the others' force stays what the
/// depth says.
bool hasStop(AxialModel model);

enum class Verdict {
  kStable,         ///< within the limit and not growing
  kChatters,       ///< bounded, but over the limit
  kDiverges,       ///< grows, is not finite, or only the gate holds it
  kNotApplicable,  ///< the case says nothing about this model
};
/// "stable", "chatters", "diverges"; "" where not applicable.
std::string_view verdictText(Verdict verdict);

/// One row of `needlelab-sim stability` (DESIGN §5). Empty numbers are null in JSON.
struct CaseRow {
  std::string case_name;
  AxialModel model = AxialModel::kEnhancedTrackingWall;
  bool applicable = false;
  bool finite = false;
  std::optional<double> max_force_N;
  std::optional<double> max_unexplained_step_N;
  std::optional<double> chatter_N;  ///< RMS of the force in 50-500 Hz over the case's window
  std::optional<double> energy_J;   ///< given to the hand, net
  std::optional<double> measured;   ///< what the case judges, in the unit of `quantity`
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
  std::string name;         ///< as in DESIGN §10 and in cases.json
  std::string summary;      ///< what it shows, a short sentence
  bool axial = false;       ///< says something about every axial model; else about the wall only
  bool prescribed = false;  ///< motion prescribed (° in DESIGN §10), not a closed loop
  CaseRun run;
};

std::vector<StabilityCase> holdCases();
std::vector<StabilityCase> motionCases();
std::vector<StabilityCase> scanCases();
/// All of them: holds, prescribed motions, then stiffness, release and missing ticks.
std::vector<StabilityCase> allCases();

/// Runs a case; a row that is not applicable where the case says nothing about `model`.
Result<CaseOutcome> runCase(const StabilityCase& hard_case, const CaseSettings& settings, AxialModel model,
                            const ForceSourceFactory& source);

/// Sets `passed` and `verdict` from `measured ≤ limit`, `finite` and whether it grows.
void judge(CaseRow& row, bool growing);

}  // namespace needlelab
