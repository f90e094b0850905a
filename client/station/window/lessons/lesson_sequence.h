/// Runs one lesson after another at the request of a person at the window.
#pragma once

#include <csignal>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/station/run/io/options.h"
#include "client/station/run/station.h"
#include "client/station/run/station_run.h"
#include "client/station/window/lessons/fetch_ahead.h"
#include "client/station/window/lessons/lesson_board.h"
#include "common/base/secret.h"

namespace needlelab {

/// Keeps a trainee's code, once the server accepted it, for the same trainee's next lesson, until the Start
/// screen comes, somebody else practises, or two minutes have passed since the lesson ended.
///
/// Thread: any thread constructs it; `run` on the lessons' thread, which is not the window's. All other
/// communication uses the board and `requests`.
class LessonSequence {
 public:
  /// All arguments must outlive it. `alone`: no person is at the window (no display). `begins`: the first
  /// lesson begins at once.
  LessonSequence(const StationOptions& options, const sigset_t& stop_signals, LessonBoard& board, bool alone,
                 bool begins, TimeSource& time = machineTime());
  ~LessonSequence() { forgetCode(); }
  LessonSequence(const LessonSequence&) = delete;
  LessonSequence& operator=(const LessonSequence&) = delete;

  /// Runs until a person quits or a stop signal comes. Returns the program's exit code: 1 if a lesson ended
  /// in FAULT or is not stored safely; if no lesson could begin, the error's code.
  int run();
  /// For stops and acknowledgements. Thread: any.
  [[nodiscard]] LessonRequests& requests() { return home_.requests(); }
  /// Returns whether a thread hangs in a device driver. In that case end the program with endProgram.
  [[nodiscard]] bool hangs() const { return hangs_; }

 private:
  bool open();
  void showStart();
  void refreshLists(const std::string& trainee);
  void updateStanding(const std::string& trainee);
  void keepCurriculum(Status asked, const StartLists& lists);
  void fetchAhead();
  void prefetch();
  [[nodiscard]] StartLists listsNow() const;
  void reportTrouble(const Status& asked) const;
  Result<pb::Reply> requestLists(Uplink& uplink, pb::Request request);
  void updateDevice();
  void updateServer();
  void handle(const BoardRequest& request);
  void practise(const LessonChoice& choice, const std::string& typed_code = {});
  void cannotBegin(const Error& error, const LessonChoice& choice, bool code_typed, bool code_kept);
  void forgetCode();
  void showOutcome();
  void reportLast();
  [[nodiscard]] LessonChoice firstChoice() const;

  const StationOptions& options_;
  const sigset_t& signals_;
  LessonBoard& board_;
  const bool alone_, begins_;
  TimeSource& time_;
  StationHome home_;
  std::unique_ptr<StationRun> last_;      // not reported yet
  std::optional<LessonOutcome> outcome_;  // the outcome of last_
  std::vector<StationSummary> earlier_;
  std::string kept_code_;     // accepted by the server in the last lesson, for the next lesson of
  std::string kept_code_of_;  // this trainee
  std::uint64_t code_questions_ = 0;
  FetchAhead ahead_{options_};
  std::string lists_made_with_;  // the server's state when the lists were made
  std::int64_t list_refresh_ns_ = 0, next_ahead_ns_ = 0;
  std::int64_t next_device_look_ns_ = 0, next_server_look_ns_ = 0, drain_until_ns_ = 0;
  std::int64_t keep_code_until_ns_ = 0;
  bool device_ready_ = false;
  std::optional<int> code_;  // worst code so far
  int failed_to_begin_ = 0;
  bool quit_ = false, hangs_ = false;
};

}  // namespace needlelab
