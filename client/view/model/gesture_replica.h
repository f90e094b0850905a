/// Computes the values that samples do not contain (entry, trajectory, α, forces by effect) by running the
/// engine again along the samples' poses. Values that samples contain (contact, layer, phase, ruptures, the
/// wall's position) override the engine's in each tick, because rounded poses would change some of them
/// (common/haptics/effects/resume.h).
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "common/gesture/sample.h"
#include "common/haptics/body/path_snapshot.h"
#include "common/haptics/cut_snapshot.h"
#include "common/haptics/effects/effect_entry.h"
#include "common/haptics/engine.h"

namespace needlelab {

/// One tick's values for a view. Forces act on the hand; along u, cutting is negative.
struct Moment {
  std::uint64_t tick = 0;
  double time_s = 0;  ///< tick/rate: since the session's tick 0, including missed ticks
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
  bool inside = false;   ///< during an insertion; otherwise entry, u and tilt are
                         ///< meaningless
  double depth_m = 0;    ///< δ, always
  Vec3 p_entry_W_m;      ///< P0
  Vec3 u_W;              ///< direction of the trajectory, unit
  double alpha_rad = 0;  ///< α(d_t); π/4 outside
  double tilt_rad = 0;   ///< θ, between the needle's axis and u
  /// Force terms by Effect: along u and signed, or a magnitude; 0 while `approximate`.
  std::array<double, kEffectCount> terms{};
  Vec3 clamping_W;  ///< unit vector of the clamping force; zero without one
  /// In a body: the path that the tick was stepped on, as it gave way to the tip; while bone or hub hold the
  /// tip back, the one before, because a path lies where the hand is. Null: none, or other scenes.
  std::shared_ptr<const PathLayers> path;
  /// The replica cannot follow, and the values that it computes may be wrong (the sample's own are not
  /// affected): since the tip was last outside, ticks are missing or samples left out; or the scene has
  /// CUT_MEMORY and earlier cuts are unknown; or the scene has a body and the station's paths of this
  /// insertion are not all known; or in this tick the engine's force, layer or contact differs from the
  /// sample's by more than rounding explains
  /// (`kRoundingExplains_N`).
  bool approximate = false;

  double& term(Effect effect) { return terms[static_cast<std::size_t>(effect)]; }
  [[nodiscard]] double term(Effect effect) const { return terms[static_cast<std::size_t>(effect)]; }
};

/// Whether the needle has its cap on (PALPATION).
inline bool isCapped(const Moment& moment) {
  return (moment.flags & kFlagCapped) != 0;
}

/// The line of a needle, with the path that the engine stepped on along it.
struct NeedleLine {
  Vec3 entry_W_m, u_W;
  double slant = 1;                                  ///< depth below the path's plane per length of needle
  std::shared_ptr<const PathLayers> path = nullptr;  ///< null: not known, or no body
};
/// The needle's line in tissue; before it, where a body's path begins. Nullopt with the cap on, and outside
/// without a path.
std::optional<NeedleLine> lineOf(const Moment& moment);
/// Whether bone or hub hold a tip back that the hand has brought `way_m` from its entry.
constexpr bool isHeldBack(double way_m, double insertion_m) {
  return way_m > insertion_m + 2e-4;
}

/// Copies the sample's values into the moment. Keeps the last position or rotation if the sample's is
/// invalid. `loop_rate_hz`: rate of the tick numbers.
void copySample(const GestureSample& sample, double loop_rate_hz, Moment& moment);

/// Thread: one at a time. Memory: about 40 KiB. `feed` costs about as much as an engine tick (well under 1
/// µs). Deterministic; unrounded samples give bit-identical results to the station's engine.
class GestureReplica {
 public:
  /// `model`: the session's scene, compiled for the rate of the *stream*. If only every n-th sample arrives
  /// (a thinned recording, a slower viewer), compile it for 1/n of the loop's rate and set `reduced_rate`:
  /// then everything inside the tissue is `approximate`. `loop_rate_hz`: rate of the tick numbers; 0: the
  /// model's.
  explicit GestureReplica(std::shared_ptr<const SceneModel> model, bool reduced_rate = false,
                          double loop_rate_hz = 0);
  GestureReplica(GestureReplica&&) noexcept;
  GestureReplica& operator=(GestureReplica&&) noexcept;
  ~GestureReplica();

  /// Processes the next sample. The station did not step missed ticks either, so a gap in the tick numbers
  /// alone stays exact. A sample that is older than the last one, or from another session, restarts the
  /// replica. Samples that are not finite are not stepped; their finite values are shown.
  const Moment& feed(const GestureSample& sample);
  /// Feeds each sample; returns the last one's Moment.
  const Moment& feed(std::span<const GestureSample> samples);
  /// Reports lost samples (a dropped live frame, skipped chunks). Until the tip is outside again, entry and
  /// trajectory stay unchanged, or are guessed from the pose if the entry was missed. With CUT_MEMORY
  /// everything inside is `approximate` until `takeCuts` or `restart`; likewise if the first sample is not
  /// from the session's start.
  void noteGap();
  /// Takes the station's cut memory after the last fed sample, with the tip outside; ignores any other. The
  /// following insertions are exact again.
  void takeCuts(const CutSnapshot& snapshot);
  /// In a scene with a body: takes a path of the station, before the sample of its tick is fed; ignores older
  /// ones. An insertion is exact if the path at its entry and each new one within it were taken. Otherwise
  /// the replica finds its own path, and everything inside is `approximate`.
  void takePath(const PathSnapshot& snapshot);
  /// Takes each path of a list (pathsIn), of a chunk or a live frame. Safe for any bytes.
  void takePaths(ByteView list);
  /// Forgets everything, for a new session or a jump in a replay.
  void restart();

  [[nodiscard]] const Moment& now() const;
  /// Returns the engine's report on the last stepped sample.
  [[nodiscard]] const StepReport& report() const;
  /// Returns the number of samples fed since the start.
  [[nodiscard]] std::uint64_t fed() const;
  /// The scene's model; in a body, not that of a path.
  [[nodiscard]] const SceneModel& model() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Computes the Moments of a session's samples in tick order; keeps every `keep_every`-th and the last (1
/// keeps all). For replays and reports.
std::vector<Moment> momentsOf(std::shared_ptr<const SceneModel> model, std::span<const GestureSample> samples,
                              std::size_t keep_every = 1);

/// |force| after the gate.
double forceOf(const Moment& moment);
/// Returns the terms of a tick's force, by Effect.
std::array<double, kEffectCount> termsOf(const StepReport& report);
/// Returns an effect's contribution to the moment's force or torque; the torque is the sample's own.
double termOf(const EffectEntry& effect, const Moment& moment);

/// Returns a Moment from a sample alone, without the engine: entry, trajectory, α and the force terms stay
/// unknown. `loop_rate_hz`: rate of the tick numbers.
Moment momentOfSample(const GestureSample& sample, double loop_rate_hz);

}  // namespace needlelab
