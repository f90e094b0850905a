/// The window's model of the running lesson, built from the board's samples. No drawing.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "client/station/run/lesson_observer.h"
#include "client/view/model/gesture_replica.h"
#include "client/view/model/gesture_trace.h"
#include "client/view/model/scene_view.h"
#include "common/base/bytes.h"

namespace needlelab {

/// Thread: the window's.
class LessonFollow {
 public:
  /// Errors: from sceneViewOf.
  static Result<std::unique_ptr<LessonFollow>> make(std::shared_ptr<const LessonBeginning> beginning);

  /// Another one of the same scene, without samples.
  [[nodiscard]] std::unique_ptr<LessonFollow> restarted() const;

  /// Adds samples in tick order. `dropped`: the number of samples that the window lost just before them.
  /// `cut_memory`: the memory of cuts after one of the samples (encodeCuts); empty: not known. `paths`: in a
  /// body, the list of the samples' paths (appendPath).
  void feed(const std::vector<GestureSample>& samples, std::uint64_t dropped, ByteView cut_memory = {},
            ByteView paths = {});

  [[nodiscard]] const LessonBeginning& beginning() const { return *beginning_; }
  [[nodiscard]] const std::shared_ptr<const LessonBeginning>& sharedBeginning() const { return beginning_; }
  [[nodiscard]] const std::shared_ptr<const SceneView>& scene() const { return scene_; }
  /// The exercise's planned line in W; nothing without a plan or in a lesson from a profile file.
  [[nodiscard]] const std::optional<PlanView>& plan_W() const { return plan_W_; }
  [[nodiscard]] const Moment& now() const { return replica_.now(); }
  [[nodiscard]] const GestureTrace& trace() const { return trace_; }
  /// Number of samples that a slow window lost. The recording has them.
  [[nodiscard]] std::uint64_t dropped() const { return dropped_; }
  [[nodiscard]] bool begun() const { return replica_.fed() > 0; }

 private:
  LessonFollow(std::shared_ptr<const LessonBeginning> beginning, std::shared_ptr<const SceneView> scene);

  std::shared_ptr<const LessonBeginning> beginning_;
  std::shared_ptr<const SceneView> scene_;
  std::optional<PlanView> plan_W_;
  GestureReplica replica_;
  GestureTrace trace_;
  std::uint64_t dropped_ = 0;
};

}  // namespace needlelab
