/// Runs the engine over a motion, alone or together with the reference, for the tests of this folder.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/haptics/engine.h"
#include "tests/support/run_form.h"
#include "tests/support/scenes/motions.h"
#include "tests/support/scenes/scenes.h"

namespace needlelab::test {

enum class Defect : std::uint8_t;

/// Compiles a spec that must be valid; otherwise throws with the message.
SceneModel compiled(const SceneSpec& spec, double rate_hz);

/// The engine with its own state, for tick-by-tick tests.
class EngineRun {
 public:
  EngineRun(const SceneSpec& spec, double rate_hz)
      : model_(std::make_unique<SceneModel>(compiled(spec, rate_hz))), state_(std::make_unique<SimState>()) {}
  StepReport step(const TipSample& sample) {
    StepReport report;
    needlelab::step(*model_, sample, *state_, report);
    return report;
  }
  std::vector<StepReport> run(const Motion& motion) {
    std::vector<StepReport> reports;
    reports.reserve(motion.size());
    for (const auto& sample : motion) reports.push_back(step(sample));
    return reports;
  }
  [[nodiscard]] const SceneModel& model() const { return *model_; }
  [[nodiscard]] const SimState& state() const { return *state_; }

 private:
  std::unique_ptr<SceneModel> model_;
  std::unique_ptr<SimState> state_;
};

/// The states that comparisons covered, so that a test can check the coverage.
struct Seen {
  std::uint32_t flags = 0;        ///< StepFlag, of any tick
  std::uint32_t phases = 0;       ///< bit (1 << phase)
  std::size_t ticks = 0;          ///< in the tissue
  bool tracks_undecided = false;  ///< `ReferenceEngine::tracksUndecided` of the last comparison
};

/// Describes the first tick at which engine and reference differ. Returns nothing if they agree to 1e-9 N and
/// 1e-9 N·m. `planted`: the reference's fault, as a control; by default there is none.
std::optional<std::string> firstDifference(const SceneSpec& spec, double rate_hz, const Motion& motion,
                                           Seen* seen = nullptr, Defect planted = Defect{});

/// Returns the work of the force and torque on the hand over a prescribed motion, in J, by the trapezoidal
/// rule.
double energyToHand(const Motion& motion, const std::vector<StepReport>& reports);

/// Returns the work of the force alone (at the tip), in J.
double forceWork(const Motion& motion, const std::vector<StepReport>& reports);

}  // namespace needlelab::test
