/// Prescribed motion: common code of the cases marked ° in tests/stability/README.md. The tip follows the
/// case's path, independent of the force.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "client/sim/stability/case.h"
#include "client/sim/stability/gated_run.h"
#include "client/sim/stability/passivity_gesture.h"
#include "client/sim/stability/passivity_observer.h"

namespace needlelab {

/// All that one tick saw and gave.
struct MotionTick {
  TipSample tip;
  StepReport report;
  double slant = 1;  ///< c
};

struct MotionRun {
  double rate_hz = 1000;
  double axial_stiffness_N_per_m = 0;
  std::vector<MotionTick> ticks;
};

/// Steps a new source over the samples. Errors: those of the source.
Result<MotionRun> runMotion(const ForceSourceFactory& source, const SceneSpec& scene,
                            const std::vector<TipSample>& samples, double rate_hz);
/// The poses of a plan, tick by tick.
std::vector<TipSample> samplesOf(const HandPlan& plan, double rate_hz);

/// The motion in a case's `field` in cases.json. Errors: kInvalidInput naming the field.
Result<PassivityGesture> motionOf(const CaseSettings& settings, std::string_view case_name,
                                  std::string_view field = "motion");

/// The run under the passivity observer; `with_slant` false judges force steps by ΣK·|Δp| alone.
PassivityRecord observed(const MotionRun& run, bool with_slant = true);

/// Fills finite, greatest force, unexplained step and energy (the greater of the net energy and the running
/// maximum of any insertion).
CaseRow rowOf(const PassivityRecord& record);

/// Fills finite and greatest force from the wrenches sent to the device.
CaseRow rowOf(const std::vector<GatedTick>& ticks);

/// Sets quantity, measured value and limit, and judges them.
void judgeMotion(CaseRow& row, std::string quantity, double measured, double limit);

/// The size of the force over time, for a picture.
CaseTrace forceTrace(const MotionRun& run, std::string label);

// along u
Result<CaseOutcome> retreatInRamp(const CaseSettings&, AxialModel, const ForceSourceFactory&);
Result<CaseOutcome> exitNormal(const CaseSettings&, AxialModel, const ForceSourceFactory&);
Result<CaseOutcome> beyondTheNeedle(const CaseSettings&, AxialModel, const ForceSourceFactory&);
Result<CaseOutcome> layersInOneTick(const CaseSettings&, AxialModel, const ForceSourceFactory&);

// fixture and orientation limit
Result<CaseOutcome> tiltPump(const CaseSettings&, AxialModel, const ForceSourceFactory&);

/// Bad samples, with the gate in its place; without it they are the negative control.
enum class Gate : bool { kAbsent, kPresent };
Result<CaseOutcome> startsInside(const CaseSettings&, AxialModel, const ForceSourceFactory&);
Result<CaseOutcome> teleport(const CaseSettings&, AxialModel, const ForceSourceFactory&,
                             Gate gate = Gate::kPresent);
Result<CaseOutcome> notANumber(const CaseSettings&, AxialModel, const ForceSourceFactory&,
                               Gate gate = Gate::kPresent);
Result<CaseOutcome> frozenDevice(const CaseSettings&, AxialModel, const ForceSourceFactory&,
                                 Gate gate = Gate::kPresent);
Result<CaseOutcome> flippedAxis(const CaseSettings&, AxialModel, const ForceSourceFactory&,
                                Gate gate = Gate::kPresent);

// random_energy.cpp: random gestures, and the one that gets energy from a late loop without the passivity
// control
Result<CaseOutcome> randomEnergy(const CaseSettings&, AxialModel, const ForceSourceFactory&);
Result<CaseOutcome> randomEnergySeed(const CaseSettings&, AxialModel, const ForceSourceFactory&);

// … and gestures at the end of a mounted tool; and the passivity control
Result<CaseOutcome> toolGestures(const CaseSettings&, AxialModel, const ForceSourceFactory&);
Result<CaseOutcome> passivityTransparent(const CaseSettings&, AxialModel, const ForceSourceFactory&);

// passivity_cases.cpp: a run with the passivity control, beside the same without
struct ControlledRuns {
  PlantRun without, with;
};
Result<ControlledRuns> controlledRuns(const ForceSourceFactory& source, const SceneSpec& scene,
                                      const HandPlan& plan, PlantOptions plant);
/// Raises the row's energies at the grip, without and with the control, and what it takes off.
void putControlled(CaseRow& row, const ControlledRuns& runs);
/// "without it 4.4 mJ, with it 0 mJ; it takes off up to 1.2 N".
std::string controlledNote(const CaseRow& row);

// device_cases.cpp: what the gate cannot see, or must bridge
Result<CaseOutcome> glitchUnderGate(const CaseSettings&, AxialModel, const ForceSourceFactory&,
                                    Gate gate = Gate::kPresent);
Result<CaseOutcome> frozenAxis(const CaseSettings&, AxialModel, const ForceSourceFactory&,
                               Gate gate = Gate::kPresent);
Result<CaseOutcome> quaternionSign(const CaseSettings&, AxialModel, const ForceSourceFactory&);
Result<CaseOutcome> clockSteps(const CaseSettings&, AxialModel, const ForceSourceFactory&,
                               Gate gate = Gate::kPresent);

// line_cases.cpp: a hand leans on a tool's handle; `limiter` stands for the gate between engine and device
/// One tick: the wrench at the handle that is rendered for the wanted one.
using WrenchLimiter = std::function<Wrench(const TipSample& tip, const Wrench& wanted)>;
/// A new one, as before the first tick.
using WrenchLimiterFactory = std::function<WrenchLimiter(double rate_hz)>;
Result<CaseOutcome> leaningOnTool(const CaseSettings&, AxialModel, const ForceSourceFactory&,
                                  const WrenchLimiterFactory& limiter);

// late and loose devices
enum class Told { kAsMeasured, kOneTick };  ///< the delay and lag that the passivity control is told
/// With the passivity control where passivity is not proven, as in a station.
Result<CaseOutcome> lateContact(const std::string& name, const CaseSettings& settings, AxialModel model,
                                const ForceSourceFactory& source, Told told);

}  // namespace needlelab
