/// A simulated hand that holds the device's handle: a spring and a damper between the handle and where the
/// hand wants it.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "client/device/hand_plan.h"
#include "client/device/hand_tremor.h"
#include "client/device/steered_aim.h"
#include "common/haptics/geometry.h"

namespace needlelab {

/// Everything that can be said of a hand on a command line. The defaults are DESIGN §10's hand with normal
/// tremor.
struct HandOptions {
  double stiffness_N_per_m = 300;                ///< [0, 10000]
  double damping_Ns_per_m = 3;                   ///< [0, 100]
  double rotational_stiffness_Nm_per_rad = 2;    ///< [0, 100]
  double rotational_damping_Nms_per_rad = 0.05;  ///< [0, 5]
  /// How fast the hand makes up for what its spring gave way, as people do: its aim moves by this share of
  /// the error per second, [0, 20]. 0 = a spring and a damper only, as in DESIGN §10. On a command line the
  /// default is kCommandLineCorrection_per_s (hand_cli.h), so that a plan's target is reached through firm
  /// tissue.
  double correction_per_s = 0;
  /// From this time on the hand does not touch the handle any more, however the plan goes on; 0 = it never
  /// lets go. In s, [0, 1e6]. For studies; not on a command line.
  double let_go_s = 0;
  double tremor_m = 50e-6;  ///< peak per axis in 8-12 Hz, [0, 0.005]
  double speed_mps = 0.02;  ///< of insertion and withdrawal, (0, 0.5]
  double hold_s = 2;        ///< at the target, (0, 600]
  /// Draws the plunger back before it injects, as one is taught to. On a command line the default is yes.
  bool aspirate = false;
  std::uint64_t seed = 1;    ///< of the tremor
  std::uint64_t repeat = 1;  ///< how often the plan is done; 0 = without end
  /// [0, 1], from a beginner to an expert: what the plan `target` is like then (skilled_hand.h). Tremor and
  /// speed are set beside it.
  std::optional<double> skill = std::nullopt;
  /// `target[:NAME]`, `retry[:NAME]`, `depth:METRES`, `rest`, `pointer`, or a CSV file of tip poses in W (see
  /// hand_plan_choice.h)
  std::string plan = "target";
};

/// How a rigid handle moves.
struct HandleState {
  Pose X_WH;
  Vec3 v_W_mps;
  Vec3 w_W_radps;  ///< angular velocity, in W
};

/// Thread: one at a time. `pull` is real-time safe.
class Hand {
 public:
  /// `X_HT`: the tip in the handle's frame, as in tool_transform.h. `step_s`: time between two calls of
  /// `pull`. With `steering` the hand goes after its wishes in place of the plan, of which it has the start
  /// only, and is never finished.
  Hand(const HandOptions& options, HandPlan plan, const Pose& X_HT, double step_s,
       std::shared_ptr<HandSteering> steering = nullptr);

  /// Where the hand wants the handle at the first step.
  [[nodiscard]] Pose startPose() const;
  /// Force and torque (about the handle's origin, in W) of the hand on the handle, and one step of time
  /// forward.
  Wrench pull(const HandleState& handle) noexcept;
  /// The plan is done, with its repeats.
  [[nodiscard]] bool finished() const noexcept;
  [[nodiscard]] double plunger() const noexcept { return plunger_; }
  /// Where the hand wants the handle at the step of the last `pull`, tremor included.
  [[nodiscard]] const Pose& wanted() const noexcept { return wanted_; }

 private:
  HandAim plannedAim() const noexcept;

  HandOptions options_;
  HandPlan plan_;
  std::optional<SteeredAim> steered_;
  Pose X_TH_;
  double step_s_;
  HandTremor tremor_;
  std::int64_t step_ = 0;
  double plunger_ = 0;
  Pose wanted_;
  Vec3 correction_W_m_;  // what the aim was moved by so far
};

}  // namespace needlelab
