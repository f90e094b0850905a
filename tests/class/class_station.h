/// One attempt by a simulated hand on virtual time: the same recording as a station's, in a fraction of the
/// time.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "client/net/spool/spool.h"
#include "client/net/uplink/uplink.h"
#include "common/base/result.h"
#include "common/gesture/sample.h"
#include "common/haptics/scene_model.h"
#include "common/haptics/scene_spec.h"
#include "needlelab/control.pb.h"
#include "needlelab/profile.pb.h"
#include "tests/class/timetable.h"

namespace needlelab {

inline constexpr double kClassRate_hz = 1000;
/// The station's clock at the first tick of each session.
inline constexpr std::int64_t kClassClock_ns = 1'000'000'000;

/// A lesson, ready to be practised.
struct ClassLesson {
  pb::Profile profile;
  std::uint32_t profile_revision = 0;
  pb::Exercise exercise;
  SceneSpec scene;
  SceneModel model;
  std::optional<Vec3> entry_m;  ///< marked on the skin
  Vec3 tip_target_m;
};

/// Errors: kInvalidInput: a profile or exercise that cannot be read, or without a target.
Result<ClassLesson> classLessonOf(const pb::Lesson& message);

/// In closed loop with the engine and a simulated device; until the plan is done or the exercise's time is
/// up. Errors: kFailed, when the gate took the force away.
Result<std::vector<GestureSample>> practiseOnce(const ClassLesson& lesson, double skill, std::uint64_t seed);

// A station of the class: it asks the server for lessons, lets simulated trainees practise them, and uploads
// the recordings with the station's own parts (client/net).

/// Outcome of a planned attempt.
struct ClassSession {
  PlannedAttempt plan;
  std::string session_id;  ///< empty: it was not begun
  std::uint64_t samples = 0;
  bool closed = false;         ///< the server has verified it
  std::optional<bool> passed;  ///< as the server scored it
  std::string trouble;         ///< why it was not begun, or not taken
  bool locked = false;         ///< not begun, because the server said no to this trainee
};

struct ClassPlace {
  Endpoint server;
  std::string ca_file, key_file;
  std::filesystem::path spool;  ///< a folder of this station alone
};

/// Thread: one.
class ClassStation {
 public:
  /// Calls `done()` after each attempt, on this station's thread.
  ClassStation(ClassPlace place, const std::vector<ClassTrainee>& trainees,
               const std::vector<std::string>& exercises, std::function<void()> done);
  ~ClassStation();
  ClassStation(const ClassStation&) = delete;
  ClassStation& operator=(const ClassStation&) = delete;

  /// Key and server. Errors: kInvalidInput, kUnavailable, kDenied.
  Status connect();
  /// Runs all attempts in order; notes a refused attempt and continues. Errors: those that end the work: a
  /// server that stays unavailable, a full disk, a gesture ended by the gate.
  Status practise(std::vector<ClassSession>& attempts, const std::function<bool()>& stopped);

 private:
  Status one(ClassSession& attempt);
  Result<const ClassLesson*> lessonOf(const std::string& exercise, const pb::Lesson& message);
  Result<std::shared_ptr<SpoolSession>> record(const ClassSession& attempt, const ClassLesson& lesson,
                                               const std::vector<GestureSample>& samples);
  Status settle(std::vector<ClassSession>& attempts, std::size_t first, std::size_t end);

  ClassPlace place_;
  const std::vector<ClassTrainee>& trainees_;
  const std::vector<std::string>& exercises_;
  std::function<void()> done_;
  std::string station_;
  std::map<std::string, ClassLesson> lessons_;  // by exercise: a body takes a while to be made ready
  std::unique_ptr<Spool> spool_;
  std::mutex mutex_;  // guards verdicts_
  std::map<std::string, pb::SessionClosed> verdicts_;
  std::unique_ptr<Uplink> uplink_;  // after all that its thread uses
};

}  // namespace needlelab
