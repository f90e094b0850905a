/// The engine with its state, for every scene. In a body it steps on the path that another thread found for
/// it (FORCE_MODEL.md, "A body"): a path asked for in a tick is used 5 ms later, so a run, a station and a
/// replay agree. In a scene with PALPATION it also has the needle's cap. In all other scenes it is
/// `step` and one comparison.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>

#include "common/haptics/body/path_stack.h"
#include "common/haptics/effects/resume.h"
#include "common/haptics/engine.h"

namespace needlelab {

/// From the tick that asks for a path to the one that uses it: 5 ms.
inline std::uint64_t pathTicks(double rate_hz) {
  return static_cast<std::uint64_t>(std::max(1.0, std::ceil(0.005 * rate_hz)));
}

/// Makes paths for one engine, one at a time. The engine calls it in its ticks: no function may lock,
/// allocate or throw, if the engine is to be real-time safe.
class PathMaker {
 public:
  virtual ~PathMaker() = default;
  /// Begins to make a path. The last one was taken.
  virtual void ask(const PathAsk& ask) noexcept = 0;
  /// Whether it is made; then `made` is it, or null if there is none. The engine owns it until it retires it.
  virtual bool take(PathStack*& made) noexcept = 0;
  /// The engine uses a path no more; it is not null.
  virtual void retire(PathStack* path) noexcept = 0;
};

/// Makes a path while it is asked: for all that is not real-time.
class PathsInPlace final : public PathMaker {
 public:
  explicit PathsInPlace(const SceneModel& body) : body_(body) {}
  void ask(const PathAsk& ask) noexcept override;
  bool take(PathStack*& made) noexcept override;
  void retire(PathStack* path) noexcept override;
  /// Has the same answer as another.
  void continueFrom(const PathsInPlace& other);

 private:
  const SceneModel& body_;
  std::unique_ptr<PathStack> made_;
};

/// Thread: one at a time. Real-time safe if its PathMaker is; it allocates in its constructor only.
class SceneEngine {
 public:
  /// `model` must outlive the engine. In a body, `paths` makes its paths and must outlive it, too; null: they
  /// are made in place.
  explicit SceneEngine(const SceneModel& model, PathMaker* paths = nullptr);
  SceneEngine(SceneEngine&&) noexcept;
  SceneEngine& operator=(SceneEngine&&) noexcept;
  ~SceneEngine();

  /// One tick. In a body, `report.layer` is a structure's index, as in a shell that of a layer of the
  /// profile.
  void step(const TipSample& sample, StepReport& report) noexcept {
    if (is_plain_) [[likely]]
      return needlelab::step(*model_, sample, state_, report);
    stepOther(sample, report);
  }

  /// Asks for the needle's cap to be on or off, in a scene with PALPATION: it is from the next tick on that
  /// allows it (changeCap). Off at the start.
  void wantCap(bool on) noexcept;
  [[nodiscard]] bool isCapped() const noexcept { return state_.palpation.capped; }

  /// As needlelab::stepAsStored. A stored tick also says whether the cap was on, and in a body whether its
  /// path came too late. A path that was given for it replaces the engine's own; during an insertion whose
  /// path was given, no other path begins. Not for the haptic thread.
  StoredDifference stepAsStored(const TipSample& sample, const StoredTick& stored, StepReport& report);

  /// As `step`, but the cap is on, and in a body the paths begin, as in stepAsStored: forces of the engine
  /// itself on the station's paths. Not for the haptic thread.
  void stepOnPaths(const TipSample& sample, const StoredTick& stored, StepReport& report);

  /// The scene of this tick: in a body, of the path in use; before there is one, the model of the body.
  [[nodiscard]] const SceneModel& model() const noexcept { return *model_; }
  [[nodiscard]] const SimState& state() const noexcept { return state_; }
  [[nodiscard]] SimState& state() noexcept { return state_; }

  /// A body's path in use; null before there is one, and in other scenes.
  [[nodiscard]] const PathLayers* path() const noexcept;
  /// How many paths have been in use since the start.
  [[nodiscard]] std::uint64_t pathsUsed() const noexcept;
  /// The path in use with the skin as it gave way to the tip: given to another engine, it has the same bits
  /// there. There is a path. Not for the haptic thread.
  [[nodiscard]] PathLayers pathInUse() const;
  /// Gives the path of a recording or a live frame, for the next tick that is stored as beginning one
  /// (kFlagNewPath), or at once outside of the tissue. `enters`: the next tick is stored as an entry, so the
  /// engine is outside, too: with its own path it may have entered a little earlier. False: it was ignored,
  /// as it has other structures than the scene, or makes no scene. Not for the haptic thread.
  bool givePath(const PathLayers& path, bool enters = false);

  /// Ends an insertion without a tick: the tip is outside after a FAULT, wherever outside. In a body the path
  /// may be of another place; until the next one, a tip under its plane has no force. Real-time safe.
  void leaveTissue() noexcept {
    state_.inside = state_.in_limb = false;
    if (body_ != nullptr) state_.outside_once = false;
    state_.palpation = {.capped = state_.palpation.capped, .clear = false, .skin = {}, .bone = {}};
  }

  /// As before the first tick. Only where paths are made in place. Not for the haptic thread.
  void restart();
  /// As after the last tick of another engine of the same model; both make their paths in place. Not for the
  /// haptic thread.
  void continueFrom(const SceneEngine& other);

 private:
  struct InBody;
  void stepOther(const TipSample& sample, StepReport& report) noexcept;
  /// `as_stored`: takes all of the stored tick's decisions, not only its path and cap.
  void stepAtEvent(const TipSample& sample, const StoredTick* stored, StepReport& report,
                   bool as_stored = true) noexcept;
  void stepOnModel(const TipSample& sample, const StoredTick* stored, bool as_stored,
                   StepReport& report) noexcept;
  void afterStep(const TipSample& sample, StepReport& report) noexcept;
  void afterStepInside(const TipSample& sample, StepReport& report) noexcept;
  void afterStepOutside(const TipSample& sample, const StepReport& report) noexcept;

  const SceneModel* model_;
  const SceneModel* scene_;  // in a body, its own model
  SimState state_{};
  bool is_plain_ = true;  // neither a body nor PALPATION
  bool wants_cap_ = false;
  std::unique_ptr<InBody> body_;  // null in all other scenes
};

}  // namespace needlelab
