/// What the closed-loop cases share: run, fill a row, keep a curve.
#pragma once

#include <string>

#include "client/sim/stability/case.h"
#include "client/sim/stability/measures.h"

namespace needlelab {

/// Into the tissue, in W: the paths of cases.json run along it.
inline constexpr Vec3 kInward_W{0, 0, -1};

/// Makes a source for `scene` and runs it to the plan's end.
Result<PlantRun> runScene(const ForceSourceFactory& source, const SceneSpec& scene, const HandPlan& plan,
                          const PlantOptions& options);

/// finite, max force, unexplained step, chatter over the window, energy given to the hand over the whole run.
CaseRow measuredRow(const PlantRun& run, TimeWindow window, const BandFilter& band);

/// The worse of both in each number, for cases of several runs; energies: the greater.
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
  /// `quantity`: what is measured, with its unit; `band`: as of CaseEntry::chatterFilter.
  CaseTally(std::string quantity, double limit, const BandFilter& band);
  /// `measured` is compared with the limit; chatter and growth are looked for in the window.
  void add(const PlantRun& run, TimeWindow window, double measured, const std::string& label) {
    add(run, window, measured, label, growsIn(run, window));
  }
  /// The same, for runs that are meant to swing: the caller says whether one grows.
  void add(const PlantRun& run, TimeWindow window, double measured, const std::string& label, bool growing);
  /// The row, judged; at least one run was added.
  [[nodiscard]] CaseOutcome finish();

 private:
  CaseOutcome outcome_;
  BandFilter band_;
  bool growing_ = false;
};

}  // namespace needlelab
