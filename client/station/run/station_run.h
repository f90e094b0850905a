/// Runs one lesson from beginning to end, without a window (main.cpp) or with one.
#pragma once

#include <csignal>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "client/device/device.h"
#include "client/device/hand/hand.h"
#include "client/station/alarm/lesson_alarms.h"
#include "client/station/run/io/options.h"
#include "client/station/run/lesson/lesson.h"
#include "client/station/run/lesson/local_score.h"
#include "client/station/run/lesson/trainee_code.h"
#include "client/station/run/lesson_observer.h"
#include "client/station/run/loop/black_box.h"
#include "client/station/run/loop/servo_loop.h"
#include "client/station/run/station.h"
#include "client/station/run/summary.h"
#include "common/base/result.h"
#include "common/haptics/worker/path_worker.h"

namespace needlelab {

// --- the lesson that a trainee chose: from a profile file, the server, or the cache while the server is away

struct FetchedLesson {
  StationLesson lesson;
  bool code_checked = false;    ///< the server accepted the trainee's code
  bool code_unchecked = false;  ///< the server normally asks for one, but is away
  std::string person = {};      ///< "@" and the UUID of the trainee's account; empty: not known
};

/// Asks the server for the lesson, or with a profile file whether it knows the trainee; asks for the code
/// while it is missing or wrong. Stores the lesson, and whether a code is asked for, in the spool. Wipes the
/// code when it returns a lesson. `stopped`: whether to stop waiting. Errors: kCode (no right code, or the
/// server is too busy to check it), kInvalidInput (file, cache, lesson), the server's refusals, kFailed
/// (stopped). An absent server is an error only if the lesson is not in the cache. Thread: the lesson's.
Result<FetchedLesson> fetchLesson(StationHome& home, const StationOptions& options, GivenCode& code,
                                  const std::function<bool()>& stopped);

/// One lesson. Call `prepare`, `practise`, then `drain` to wait for the server, `outcome` any number of
/// times, and `report` once. Thread: one, which starts and joins all others.
class StationRun {
 public:
  /// `options` contains this lesson's trainee and exercise, `code` the trainee's. `home` is open and
  /// connected and must outlive it.
  StationRun(StationHome& home, StationOptions options, const sigset_t& stop_signals, GivenCode code = {})
      : home_(home), options_(std::move(options)), signals_(stop_signals), code_(std::move(code)) {}

  /// Prepares lesson, device and session. With a window, an exam waits first (LessonObserver::examWaits).
  /// Errors include advice; after an error there is no recording. kCode: the server asks for the trainee's
  /// code and did not get the right one.
  Status prepare();
  /// Runs the loop until the lesson ends. Errors: part of the recording is not stored safely.
  Status practise();
  /// Waits, within limits, until the server has everything.
  void drain();
  /// Returns the result so far.
  [[nodiscard]] LessonOutcome outcome();
  /// Prints the result to standard output and, with --json, as JSON after the `earlier` lessons of this
  /// program. Returns the exit code.
  int report(const LessonOutcome& outcome, const std::vector<StationSummary>& earlier = {});

  /// Returns whether a stop signal came: the program must end, not only the lesson.
  [[nodiscard]] bool interrupted() const { return interrupted_; }
  /// After `prepare`: the server accepted the trainee's code for this lesson.
  [[nodiscard]] bool codeChecked() const { return code_checked_; }

 private:
  bool isStopped();
  // steps of `prepare`
  Status getLesson();
  Status waitForExam();
  Status chooseDevice();
  Status openDevice();
  Status openSession();
  void dateBegin(pb::SessionDescription& description) const;
  void announce();
  // afterwards
  [[nodiscard]] std::int64_t resultsWithheldUntil() const;
  void scoreHere();
  StationSummary summarise();

  StationHome& home_;
  const StationOptions options_;
  const sigset_t& signals_;
  GivenCode code_;
  bool code_checked_ = false, code_unchecked_ = false;  // as in FetchedLesson
  std::string person_;                                  // likewise
  PlannedInsertion way_;                                // of the lesson's needle
  std::shared_ptr<HandSteering> steering_;              // input of the simulated hand steered in the window
  SampleRing ring_;
  StationLesson lesson_;
  LoopDelay delay_;
  std::vector<std::string> device_notes_;
  std::unique_ptr<Device> device_;
  std::shared_ptr<SpoolSession> session_;
  std::unique_ptr<PathWorker> paths_;  // null: the patient is no body
  std::unique_ptr<ServoLoop> loop_;
  AudibleTone tone_;
  LessonAlarms alarms_{tone_, options_.tone};
  std::unique_ptr<SpoolWriter> writer_;  // reports to the alarms
  std::vector<RtStep> realtime_;
  BlackBoxCounts black_box_;
  double time_limit_s_ = 0;
  bool limit_from_start_ = false;
  bool interrupted_ = false;
  std::optional<StopCause> stopped_;
  Status stored_;
  std::optional<Result<LocalScore>> local_;
};

}  // namespace needlelab
