/// Computes what recorded samples do not contain (entry, trajectory, α, forces by effect): the engine steps
/// once more along the samples' poses, on the view's side.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "common/gesture/sample.h"
#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/engine.h"

namespace needlelab {

/// All that a view shows of one tick. Forces act on the hand; along u, cutting is negative.
struct Moment {
  std::uint64_t tick = 0;
  double time_s = 0;  ///< tick/rate: since the session's tick 0, missed ticks included
  // from the sample
  Vec3 p_WT_m;
  Quat q_WT;
  Vec3 force_W_N, torque_W_Nm;  ///< after the gate, about the tip
  Vec3 wall_W_m;                ///< P0 + u·w; NaN: none
  Phase phase = Phase::kFree;
  int layer = -1;
  double insertion_m = 0, speed_mps = 0, lateral_error_m = 0;
  double plunger = 0;
  std::uint32_t flags = 0, buttons = 0;
  std::uint8_t fault = 0;
  // from the replica
  bool inside = false;   ///< an insertion is under way; else entry, u and tilt mean nothing
  double depth_m = 0;    ///< δ, always
  Vec3 p_entry_W_m;      ///< P0
  Vec3 u_W;              ///< the trajectory's direction, unit
  double alpha_rad = 0;  ///< α(d_t); π/4 outside
  double tilt_rad = 0;   ///< θ, between the needle's axis and u
  std::array<double, kEffectCount> terms{};  ///< of the force, by Effect: along u and signed, or a magnitude
  Vec3 clamping_W;  ///< unit vector of the clamping force (toward the line); zero without one
  /// Ticks are missing, or samples were thinned, since the tip was last outside: the replica's values may be
  /// off (the sample's are not).
  bool approximate = false;

  double& term(Effect effect) { return terms[static_cast<std::size_t>(effect)]; }
  [[nodiscard]] double term(Effect effect) const { return terms[static_cast<std::size_t>(effect)]; }
};

/// Copies the sample's values into the moment. An invalid place or rotation is not copied: the last one
/// stays. `loop_rate_hz`: of the ticks' numbers.
void copySample(const GestureSample& sample, double loop_rate_hz, Moment& moment);

/// Thread: one at a time. Memory: about 40 KiB. `feed` costs about a tick of the engine (well under 1 µs).
class GestureReplica {
 public:
  /// `model`: the session's scene, compiled for the rate of the *stream*: where only every n-th sample comes
  /// (a thinned recording, a viewer with a lower rate), for 1/n of the loop's rate, and `thinned` is true:
  /// then everything inside the tissue is `approximate`. `loop_rate_hz`: of the ticks' numbers; 0: the
  /// model's.
  explicit GestureReplica(std::shared_ptr<const SceneModel> model, bool thinned = false,
                          double loop_rate_hz = 0);
  GestureReplica(GestureReplica&&) noexcept;
  GestureReplica& operator=(GestureReplica&&) noexcept;
  ~GestureReplica();

  /// The next sample. Ticks that the device missed were not stepped by the station either, so a gap in the
  /// ticks' numbers alone is exact. A sample from before the last one, or of another session, restarts the
  /// replica. Samples that are not finite are not stepped; their finite values are shown.
  const Moment& feed(const GestureSample& sample);
  /// `feed` for each; the last one's Moment.
  const Moment& feed(std::span<const GestureSample> samples);
  /// Samples were lost on the way (a live frame dropped, chunks left out): until the tip is outside again,
  /// entry and trajectory stay as they were, or are guessed from the pose when the entry was missed.
  void noteGap();
  /// Forgets everything, for a new session or a jump in a replay.
  void restart();

  [[nodiscard]] const Moment& now() const;
  /// The engine's report on the last sample that was stepped.
  [[nodiscard]] const StepReport& report() const;
  /// How many samples were fed since the start.
  [[nodiscard]] std::uint64_t fed() const;
  [[nodiscard]] const SceneModel& model() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Samples of a session in the order of ticks → Moments, of every `keep_every`-th (and the last). For replays
/// and reports; 1 keeps all.
std::vector<Moment> momentsOf(std::shared_ptr<const SceneModel> model, std::span<const GestureSample> samples,
                              std::size_t keep_every = 1);

/// |force| after the gate.
double forceOf(const Moment& moment);
/// The terms of a tick's force, by Effect.
std::array<double, kEffectCount> termsOf(const StepReport& report);
/// What an effect gives to the moment's force or torque; the torque is the sample's own.
double termOf(const EffectEntry& effect, const Moment& moment);

/// A Moment from a sample alone, for where the engine cannot step along: entry, trajectory, α and the parts
/// of the force stay unknown. `loop_rate_hz`: of the ticks' numbers.
Moment momentOfSample(const GestureSample& sample, double loop_rate_hz);

}  // namespace needlelab
