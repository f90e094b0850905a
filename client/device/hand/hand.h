/// A simulated hand that holds the device's handle: a spring and a damper between the handle and its wanted
/// pose, with tremor. Its aim comes from a plan or from steering.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "client/device/hand/hand_plan.h"
#include "common/base/wait_free.h"
#include "common/haptics/geometry.h"

namespace needlelab {

/// The wanted pose of the needle's tip now, in W, and the plunger.
struct SteeringTarget {
  Pose X_WT;
  double plunger = 0;  ///< 0-1
};

/// Hands the newest target from a window to the haptic thread. Neither side waits: without new targets the
/// hand rests; after the end of the loop targets are ignored. Thread: `setTarget` by one, `fetch` by the
/// haptic thread alone.
class HandSteering {
 public:
  void setTarget(const SteeringTarget& target) noexcept { newest_.publish(target); }
  /// Returns true when `target` is newer than at the last call. Real-time safe.
  bool fetch(SteeringTarget& target) noexcept { return newest_.fetch(target); }

 private:
  LatestValue<SteeringTarget> newest_;
};

/// Random numbers with a fixed definition (SplitMix64, Steele et al. 2014), so that a seed gives the same
/// hand everywhere.
class HandRandom {
 public:
  explicit HandRandom(std::uint64_t seed) : state_(seed) {}
  std::uint64_t next() noexcept;
  /// Uniform in [0, 1), 53 bits.
  double uniform() noexcept;

 private:
  std::uint64_t state_;
};

/// Per axis three sines in [8, 12] Hz with random frequencies and phases, each of a third of the amplitude:
/// the displacement of an axis never exceeds the amplitude and comes near it repeatedly. Complex
/// multiplication advances the sines, so that the bits do not depend on the C library.
class HandTremor {
 public:
  static constexpr double kLowHz = 8, kHighHz = 12;
  static constexpr std::size_t kPartials = 3;

  /// `amplitude_m`: peak per axis. `step_s`: time between two calls of `next`.
  HandTremor(double amplitude_m, std::uint64_t seed, double step_s);

  /// Returns the displacement in W at the next step.
  Vec3 next() noexcept;
  /// Returns the frequency of a partial of an axis, in Hz.
  [[nodiscard]] double frequencyHz(std::size_t axis, std::size_t partial) const {
    return partials_[axis][partial].hz;
  }

 private:
  struct Partial {
    double hz = 0;
    double c = 1, s = 0;            // the phase now, as a point on the unit circle
    double turn_c = 1, turn_s = 0;  // turn of one step
  };
  double share_m_;
  std::array<std::array<Partial, kPartials>, 3> partials_;
};

/// Targets come 30 times a second, in steps, and may jump; the aim speeds up over 25 ms, slows down near its
/// target, and never exceeds these speeds. At rest it is at the target.
inline constexpr double kMaxAimSpeed_mps = 0.1;
inline constexpr double kMaxAimTurn_radps = 1.5;
inline constexpr double kMaxPlungerSpeed_per_s = 0.8;

/// The aim of a steered hand: follows the newest target like an arm, smoothly and with limited speed, on the
/// hand's own steps. Ignores a target that is not finite or has an invalid quaternion. Thread: one at a time.
/// `next` is real-time safe.
class SteeredAim {
 public:
  /// `step_s`: time between two calls of `next`.
  SteeredAim(std::shared_ptr<HandSteering> steering, const HandAim& start, double step_s);
  /// Returns the aim one step later.
  HandAim next() noexcept;

 private:
  std::shared_ptr<HandSteering> steering_;
  double step_s_, share_;
  HandAim aim_;
  SteeringTarget target_;
  Vec3 v_W_mps_, w_W_radps_;
};

inline constexpr double kBracingTime_s = 0.004;

/// All options of a hand. The defaults are the hand of the hard cases (tests/stability/README.md) with normal
/// tremor.
struct HandOptions {
  double stiffness_N_per_m = 300;  ///< [0, 10000]
  double damping_Ns_per_m = 3;     ///< [0, 100]
  /// Additional stiffness along the needle of a hand that rests on the patient; its damping is kBracingTime_s
  /// times it. In N/m, [0, 10000].
  double bracing_N_per_m = 0;
  double rotational_stiffness_Nm_per_rad = 2;    ///< [0, 100]
  double rotational_damping_Nms_per_rad = 0.05;  ///< [0, 5]
  /// How fast the hand corrects its spring's deflection, as humans do: its aim moves by this share of the
  /// error per second, [0, 20]. 0 = a spring and a damper only, as in the hard cases. On a command line the
  /// default is kCommandLineCorrection_per_s (hand_options.h), so that the hand reaches a plan's target
  /// through firm tissue.
  double correction_per_s = 0;
  /// The hand releases the handle at this time under any plan; 0 = never. In s, [0, 1e6]. For studies; not on
  /// a command line.
  double release_s = 0;
  /// From this time on the grip's stiffnesses and dampings are `grip_share` times as large; 0 = never. In s,
  /// [0, 1e6], and [0, 100]. For studies; not on a command line.
  double grip_changes_s = 0, grip_share = 1;
  double tremor_m = 50e-6;  ///< peak per axis in 8-12 Hz, [0, 0.005]
  double speed_mps = 0.02;  ///< of insertion and withdrawal, (0, 0.5]
  double hold_s = 2;        ///< at the target, (0, 600]
  /// Draws the plunger back before injecting, as taught. On a command line the default is yes.
  bool aspirate = false;
  bool capped = false;       ///< the lesson begins with the needle's cap on; not on a command line
  std::uint64_t seed = 1;    ///< of the tremor
  std::uint64_t repeat = 1;  ///< number of runs of the plan; 0 = endless
  /// [0, 1], from beginner to expert: the skill in the plan `target` (hand_options.h). Tremor and speed are
  /// set separately.
  std::optional<double> skill = std::nullopt;
  /// `target[:NAME]`, `retry[:NAME]`, `depth:METRES`, `rest`, `pointer`, or a CSV file of tip poses in W (see
  /// hand_options.h)
  std::string plan = "target";
};

/// Pose and velocity of a rigid handle.
struct HandleState {
  Pose X_WH;
  Vec3 v_W_mps;
  Vec3 w_W_radps;  ///< angular velocity, in W
};

/// Thread: one at a time. `pull` is real-time safe.
class Hand {
 public:
  /// `X_HT`: the tip in the handle's frame, as in geometry.h. `step_s`: time between two calls of
  /// `pull`. With `steering` the hand follows its targets, takes only the start from the plan, and never
  /// finishes.
  Hand(const HandOptions& options, HandPlan plan, const Pose& X_HT, double step_s,
       std::shared_ptr<HandSteering> steering = nullptr);

  /// Returns the wanted handle pose at the first step.
  [[nodiscard]] Pose startPose() const;
  /// Returns the hand's force and torque on the handle (about the handle's origin, in W), and advances one
  /// step.
  Wrench pull(const HandleState& handle) noexcept;
  /// Whether the plan and its repeats are done.
  [[nodiscard]] bool finished() const noexcept;
  [[nodiscard]] double plunger() const noexcept { return plunger_; }
  [[nodiscard]] bool pressesCapButton() const noexcept { return presses_cap_button_; }
  /// Returns the wanted handle pose at the last `pull`, tremor included.
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
  bool presses_cap_button_ = false;
  Pose wanted_;
  Vec3 correction_W_m_;  // of the aim so far
};

}  // namespace needlelab
