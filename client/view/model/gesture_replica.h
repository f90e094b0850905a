/// Computes the values that samples do not contain (entry, trajectory, α, forces by effect): runs the engine
/// again along the samples' poses, on the view's side. What samples contain (contact, layer, phase, ruptures,
/// the wall's place) it takes from them in each tick, because rounded poses would decide some of it otherwise
/// (common/haptics/effects/resume.h).
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "common/gesture/sample.h"
#include "common/haptics/cut_snapshot.h"
#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/engine.h"

namespace needlelab {

/// The values of a tick for a view. Forces act on the hand; along u, cutting is negative.
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
  bool inside = false;                       ///< during an insertion; else entry, u and tilt are meaningless
  double depth_m = 0;                        ///< δ, always
  Vec3 p_entry_W_m;                          ///< P0
  Vec3 u_W;                                  ///< the trajectory's direction, unit
  double alpha_rad = 0;                      ///< α(d_t); π/4 outside
  double tilt_rad = 0;                       ///< θ, between the needle's axis and u
  std::array<double, kEffectCount> terms{};  ///< force terms by Effect: along u and signed, or a magnitude
  Vec3 clamping_W;                           ///< unit vector of the clamping force; zero without one
  /// Ticks are missing, or samples were thinned, since the tip was last outside, or the scene has CUT_MEMORY
  /// and what was cut before is not known, or in this tick the engine's force, layer or contact differs from
  /// the sample's by more than rounding explains (`kRoundingExplains_N`): the replica's values may be inexact
  /// (the sample's own are not affected).
  bool approximate = false;

  double& term(Effect effect) { return terms[static_cast<std::size_t>(effect)]; }
  [[nodiscard]] double term(Effect effect) const { return terms[static_cast<std::size_t>(effect)]; }
};

/// Copies the sample's values into the moment. Keeps the last position or rotation when the sample's is
/// invalid. `loop_rate_hz`: rate of the tick numbers.
void copySample(const GestureSample& sample, double loop_rate_hz, Moment& moment);

/// Thread: one at a time. Memory: about 40 KiB. `feed` costs about a tick of the engine (well under 1 µs).
/// Same samples, same bits; samples that are not rounded give the bits of the station's engine.
class GestureReplica {
 public:
  /// `model`: the session's scene, compiled for the rate of the *stream*. If only every n-th sample arrives
  /// (a thinned recording, a viewer with a lower rate), compile it for 1/n of the loop's rate and set
  /// `thinned`: everything inside the tissue is then `approximate`. `loop_rate_hz`: rate of the tick numbers;
  /// 0: the model's.
  explicit GestureReplica(std::shared_ptr<const SceneModel> model, bool thinned = false,
                          double loop_rate_hz = 0);
  GestureReplica(GestureReplica&&) noexcept;
  GestureReplica& operator=(GestureReplica&&) noexcept;
  ~GestureReplica();

  /// Processes the next sample. The station did not step missed ticks either, so a mere gap in the tick
  /// numbers stays exact. A sample older than the last one, or of another session, restarts the replica.
  /// Samples that are not finite are not stepped; their finite values are shown.
  const Moment& feed(const GestureSample& sample);
  /// Feeds each sample; returns the last one's Moment.
  const Moment& feed(std::span<const GestureSample> samples);
  /// Reports lost samples (a dropped live frame, skipped chunks): until the tip is outside again, entry and
  /// trajectory stay unchanged, or are guessed from the pose when the entry was missed. With CUT_MEMORY
  /// everything inside is `approximate` from then on, as it is when the first sample fed is not of the
  /// session's beginning: until `takeCuts`, or `restart`.
  void noteGap();
  /// Takes the memory of the cut as the station has it after the sample that was fed last, with the tip
  /// outside; any other is ignored. The next insertions are exact again.
  void takeCuts(const CutSnapshot& snapshot);
  /// Forgets everything, for a new session or a jump in a replay.
  void restart();

  [[nodiscard]] const Moment& now() const;
  /// Returns the engine's report on the last stepped sample.
  [[nodiscard]] const StepReport& report() const;
  /// Returns the number of samples fed since the start.
  [[nodiscard]] std::uint64_t fed() const;
  [[nodiscard]] const SceneModel& model() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Computes the Moments of a session's samples in tick order; keeps every `keep_every`-th one and the last (1
/// keeps all). For replays and reports.
std::vector<Moment> momentsOf(std::shared_ptr<const SceneModel> model, std::span<const GestureSample> samples,
                              std::size_t keep_every = 1);

/// |force| after the gate.
double forceOf(const Moment& moment);
/// Returns the terms of a tick's force, by Effect.
std::array<double, kEffectCount> termsOf(const StepReport& report);
/// Returns an effect's contribution to the moment's force or torque; the torque is the sample's own.
double termOf(const EffectEntry& effect, const Moment& moment);

/// Returns a Moment from a sample alone, for cases without the engine: entry, trajectory, α and the force
/// terms stay unknown. `loop_rate_hz`: rate of the tick numbers.
Moment momentOfSample(const GestureSample& sample, double loop_rate_hz);

}  // namespace needlelab
