/// A simulated hand that holds the device's handle: a spring and a damper between the handle and where the
/// hand wants it, with tremor; its aim comes from a plan or from somebody who steers it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "client/device/hand_plan.h"
#include "common/base/wait_free.h"
#include "common/haptics/geometry.h"

namespace needlelab {

/// Where the needle's tip shall be now, in W, and the plunger.
struct SteeringTarget {
  Pose X_WT;
  double plunger = 0;  ///< 0-1
};

/// Hands the newest target from a window to the haptic thread. Neither side waits: while the window stands
/// still the hand rests, and after the loop has ended targets go nowhere. Thread: `setTarget` by one, `fetch`
/// by the haptic thread alone.
class HandSteering {
 public:
  void setTarget(const SteeringTarget& target) noexcept { newest_.publish(target); }
  /// True when `target` is newer than at the last call. Real-time safe.
  bool fetch(SteeringTarget& target) noexcept { return newest_.fetch(target); }

 private:
  LatestValue<SteeringTarget> newest_;
};

/// Random numbers with a fixed definition (SplitMix64, Steele et al. 2014), so that a seed means the same
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
/// the displacement of an axis never exceeds the amplitude and comes near it again and again. The sines are
/// turned by complex multiplication, so that no C library decides about bits.
class HandTremor {
 public:
  static constexpr double kLowHz = 8, kHighHz = 12;
  static constexpr std::size_t kPartials = 3;

  /// `amplitude_m`: peak per axis. `step_s`: time between two calls of `next`.
  HandTremor(double amplitude_m, std::uint64_t seed, double step_s);

  /// Displacement in W at the next step.
  Vec3 next() noexcept;
  /// Frequency of a partial of an axis, in Hz.
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
/// target, and never goes faster than this. At rest it is at the target.
inline constexpr double kMostAimSpeed_mps = 0.1;
inline constexpr double kMostAimTurn_radps = 1.5;
inline constexpr double kMostPlungerSpeed_per_s = 0.8;

/// The aim of a steered hand: it follows the newest target as an arm would, smoothly and not too fast. Pure
/// logic on the hand's own steps. A target that is not finite, or has a quaternion that is not a rotation, is
/// ignored. Thread: one at a time. `next` is real-time safe.
class SteeredAim {
 public:
  /// `step_s`: time between two calls of `next`.
  SteeredAim(std::shared_ptr<HandSteering> steering, const HandAim& start, double step_s);
  /// The aim one step later.
  HandAim next() noexcept;

 private:
  std::shared_ptr<HandSteering> steering_;
  double step_s_, share_;
  HandAim aim_;
  SteeringTarget target_;
  Vec3 v_W_mps_, w_W_radps_;
};

/// All options of a hand. The defaults are the hand of the hard cases (tests/stability/README.md) with normal
/// tremor.
struct HandOptions {
  double stiffness_N_per_m = 300;                ///< [0, 10000]
  double damping_Ns_per_m = 3;                   ///< [0, 100]
  double rotational_stiffness_Nm_per_rad = 2;    ///< [0, 100]
  double rotational_damping_Nms_per_rad = 0.05;  ///< [0, 5]
  /// How fast the hand makes up for what its spring gave way, as people do: its aim moves by this share of
  /// the error per second, [0, 20]. 0 = a spring and a damper only, as in the hard cases. On a command line
  /// the default is kCommandLineCorrection_per_s (hand_options.h), so that a plan's target is reached through
  /// firm tissue.
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
  /// [0, 1], from a beginner to an expert: how the plan `target` is carried out (hand_options.h). Tremor and
  /// speed are set separately.
  std::optional<double> skill = std::nullopt;
  /// `target[:NAME]`, `retry[:NAME]`, `depth:METRES`, `rest`, `pointer`, or a CSV file of tip poses in W (see
  /// hand_options.h)
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
  /// `pull`. With `steering` the hand follows its targets; it takes only the start from the plan, and never
  /// finishes.
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
  Vec3 correction_W_m_;  // of the aim so far
};

}  // namespace needlelab
