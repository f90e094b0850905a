#include "client/station/window/screens/lesson_follow.h"

#include <utility>

#include "common/haptics/cut_snapshot.h"

namespace needlelab {
namespace {

constexpr double kTraceSpan_s = 180;

GestureTrace traceOf(const LessonBeginning& beginning) {
  const StationLesson& lesson = beginning.lesson;
  const Anatomy anatomy = anatomyOf(lesson.profile, beginning.X_WL);
  return GestureTrace(kTraceSpan_s, BoneContacts(lesson.profile, anatomy), 1,
                      GestureAlarms(lesson.profile, anatomy,
                                    alarmLimitsOf(anatomy, lesson.exercise ? &*lesson.exercise : nullptr)));
}

}  // namespace

LessonFollow::LessonFollow(std::shared_ptr<const LessonBeginning> beginning,
                           std::shared_ptr<const SceneView> scene)
    : beginning_(std::move(beginning)),
      scene_(std::move(scene)),
      plan_W_(beginning_->lesson.exercise ? planViewOf(*scene_, *beginning_->lesson.exercise) : std::nullopt),
      // the beginning owns the model and lives as long
      replica_(std::shared_ptr<const SceneModel>(beginning_, &beginning_->lesson.model)),
      trace_(traceOf(*beginning_)) {}

Result<std::unique_ptr<LessonFollow>> LessonFollow::make(std::shared_ptr<const LessonBeginning> beginning) {
  ASSIGN_OR_RETURN(auto scene, sceneViewOf(beginning->lesson.profile, beginning->X_WL));
  return std::unique_ptr<LessonFollow>(
      new LessonFollow(std::move(beginning), std::make_shared<const SceneView>(std::move(scene))));
}

std::unique_ptr<LessonFollow> LessonFollow::restarted() const {
  return std::unique_ptr<LessonFollow>(new LessonFollow(beginning_, scene_));
}

void LessonFollow::feed(const std::vector<GestureSample>& samples, std::uint64_t dropped, ByteView cut_memory,
                        ByteView paths) {
  if (dropped > 0) {
    dropped_ += dropped;
    replica_.noteGap();
  }
  replica_.takePaths(paths);
  const auto cuts = cutsIn(cut_memory);
  for (const GestureSample& sample : samples) {
    trace_.push(replica_.feed(sample));
    if (cuts && sample.tick == cuts->tick) replica_.takeCuts(*cuts);
  }
}

}  // namespace needlelab
