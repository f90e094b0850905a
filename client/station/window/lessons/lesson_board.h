/// Exchange between the station's threads and the window's thread: the visible state, and a person's
/// requests.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "client/station/run/lesson/list_exercises.h"
#include "client/station/run/lesson_observer.h"
#include "common/base/bytes.h"
#include "common/base/time/time_source.h"
#include "common/gesture/sample.h"

namespace needlelab {

/// The station's stage.
enum class Stage : std::uint8_t {
  kOpening,     ///< opening the spool
  kStart,       ///< the Start screen: choice of trainee and exercise
  kPreparing,   ///< preparing the requested lesson
  kLesson,      ///< the loop runs
  kConcluding,  ///< the loop has ended; the station stores and scores the recording
  kEnd,         ///< the outcome is available
  kClosing,     ///< the program ends
  kFailed,      ///< the station cannot continue; `trouble` says why
};

/// Trainee and exercise of a lesson.
struct LessonChoice {
  std::string trainee, exercise;
  bool by_profile = false;  ///< --profile's file instead of an exercise
  friend bool operator==(const LessonChoice&, const LessonChoice&) = default;
};

/// The Start screen's lists.
struct StartLists {
  std::vector<ListedExercise> exercises;     ///< by id
  std::vector<ServerExercise> descriptions;  ///< of the server's exercises
  std::vector<std::string> trainees;         ///< names known on this station
  /// Trainee and exercise, for trainees whose standing is not known.
  std::vector<std::pair<std::string, std::string>> assigned;
  std::shared_ptr<const Curriculum> curriculum;  ///< null: the server never sent one
  std::string profile_file;                      ///< --profile; empty: none
  std::set<std::string> asks_code;               ///< trainees whose code the server has asked for before
  std::set<std::string> assigned_courses, assigned_exercises;  ///< ids of everything assigned to anyone
  std::size_t assignments = 0;  ///< a hash of all assignments; 0: not reported by the server
};

/// The state of the chosen device before a lesson.
struct DeviceReadiness {
  std::string name, state;
  bool ready = false;
  bool is_checked = false;  ///< false: not checked yet
};

struct BoardMessage {
  std::string from, text;
  std::int64_t unix_ns = 0;
  double lesson_s = -1;  ///< lesson time at arrival; −1 outside a lesson
};

/// An instructor's suggestion for the next exercise.
struct SuggestedExercise {
  std::string from, exercise;
};

/// The server asks for a trainee's code.
struct CodeQuestion {
  std::string trainee, text;  ///< the server's text for the trainee
  bool wrong = false;         ///< false: no code was given yet
  std::uint64_t number = 0;   ///< counts up: the same question again has a new number
};

/// All visible state except the samples. A copy is cheap.
struct BoardState {
  Stage stage = Stage::kOpening;
  StartLists lists;
  DeviceReadiness device;
  std::string server;  ///< short state; empty without a server
  bool server_away = false;
  LessonChoice choice;     ///< the preselection; in a lesson, its choice
  std::string preparing;   ///< the step, for a person
  std::string exam_terms;  ///< of the exam that waits for its trainee (examTerms)
  std::string trouble;     ///< why the last attempt to begin failed; empty once anything else is chosen
  std::optional<CodeQuestion> code_question;  ///< must be answered before the lesson can begin
  std::uint64_t lesson = 0;                   ///< counts up; 0: none yet
  std::shared_ptr<const LessonBeginning> beginning;
  LessonStatus status;
  AidList aids;                        ///< in effect now
  std::string aids_by;                 ///< the instructor's name; empty: the exercise's own aids
  std::vector<BoardMessage> messages;  ///< the newest 50
  std::shared_ptr<const LessonOutcome> outcome;
  std::optional<SuggestedExercise> next;
};

/// A person's request to the station.
struct BoardRequest {
  enum class Kind : std::uint8_t {
    kNothing,
    kBegin,    ///< `choice`, with `code`
    kStart,    ///< show the Start screen
    kLook,     ///< refresh exercises, trainees, device, and the standing of `choice.trainee`
    kTrainee,  ///< fetch the standing of `choice.trainee`
    kQuit,
  };
  Kind kind = Kind::kNothing;
  LessonChoice choice;
  std::string code = {};  ///< as typed; empty: the one accepted before
};

/// Thread: any but the haptic one. The window cannot block other threads: samples wait in a queue of
/// `max_pieces` (drops and counts the oldest), and every lock lasts no longer than a copy.
class LessonBoard final : public LessonObserver {
 public:
  /// `time` must outlive it.
  explicit LessonBoard(std::size_t max_pieces = 500, TimeSource& time = machineTime())
      : max_pieces_(max_pieces), time_(time) {}

  // --- the window's thread
  /// Copies the state if it is newer than `seen`, and updates `seen`.
  bool look(BoardState& state, std::uint64_t& seen) const;
  /// A piece of a lesson as its station recorded it.
  struct Taken {
    std::shared_ptr<const std::vector<GestureSample>> samples;
    Bytes cut_memory, paths;  ///< as in SamplePiece
  };
  /// Moves the new pieces of `lesson` to `pieces`, oldest first. Returns the number of samples dropped before
  /// them since the last call.
  std::uint64_t takePieces(std::uint64_t lesson, std::vector<Taken>& pieces);
  /// Replaces the waiting request, except kQuit; kTrainee replaces only another kTrainee.
  void ask(BoardRequest request);

  // --- the station's threads
  /// Returns a waiting request at once, otherwise the next one, or kNothing after `patience`.
  BoardRequest waitForRequest(std::chrono::milliseconds patience);
  /// Returns whether a person's request waits (not kTrainee), without taking it.
  [[nodiscard]] bool requestWaits() const;
  /// `change` receives a BoardState& to modify.
  template <typename Change>
  void change(Change&& change) {
    const std::scoped_lock lock(mutex_);
    change(state_);
    ++revision_;
  }
  [[nodiscard]] std::uint64_t droppedBatches() const;

  void preparing(const std::string& what) override;
  void examWaits(const std::string& terms) override;
  void began(std::shared_ptr<const LessonBeginning> beginning) override;
  void status(const LessonStatus& status) override;
  void aids(const ChosenAids& chosen) override;
  void concluding() override;
  void message(const std::string& from, const std::string& text) override;
  void nextExercise(const std::string& from, const std::string& exercise_id) override;
  void piece(const SamplePiece& piece) override;

 private:
  struct Waiting {
    Taken piece;
    std::uint64_t lesson = 0;
  };
  const std::size_t max_pieces_;
  TimeSource& time_;
  mutable std::mutex mutex_;
  std::condition_variable requested_;
  BoardState state_;
  std::uint64_t revision_ = 1;
  BoardRequest request_;
  bool quit_ = false;
  std::deque<Waiting> pieces_;
  std::uint64_t dropped_ = 0, dropped_since_ = 0;
};

}  // namespace needlelab
