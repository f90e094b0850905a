/// Exchange between the station's threads and the window's thread: the state to be shown, and a person's
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
#include <string>
#include <utility>
#include <vector>

#include "client/station/run/lesson_observer.h"
#include "client/station/run/list_exercises.h"
#include "common/gesture/sample.h"

namespace needlelab {

/// The station's stage.
enum class Stage : std::uint8_t {
  kOpening,     ///< the spool is being opened
  kStart,       ///< the Start screen: trainee and exercise are chosen
  kPreparing,   ///< a lesson was requested
  kLesson,      ///< the loop runs
  kConcluding,  ///< it has ended; the recording is being put away and scored
  kEnd,         ///< the outcome is there
  kClosing,     ///< the program ends
  kFailed,      ///< it cannot go on; `trouble` says why
};

/// Trainee and exercise of a lesson.
struct LessonChoice {
  std::string trainee, exercise;
  bool by_profile = false;  ///< --profile's file in place of an exercise
  friend bool operator==(const LessonChoice&, const LessonChoice&) = default;
};

/// The Start screen's lists.
struct StartLists {
  std::vector<ListedExercise> exercises;                      ///< by id
  std::vector<ServerExercise> descriptions;                   ///< of those that the server has
  std::vector<std::string> trainees;                          ///< names that are known here
  std::vector<std::pair<std::string, std::string>> assigned;  ///< trainee, exercise
  std::string profile_file;                                   ///< --profile; empty: none
};

/// The state of the chosen device before a lesson.
struct DeviceReadiness {
  std::string name, state;
  bool ready = false;
  bool known = false;  ///< false: not looked at yet
};

struct BoardMessage {
  std::string from, text;
  std::int64_t unix_ns = 0;
  double lesson_s = -1;  ///< in the lesson at that time; −1 outside of one
};

/// The next exercise, as an instructor suggests.
struct SuggestedExercise {
  std::string from, exercise;
};

/// All but the samples. A copy is cheap.
struct BoardState {
  Stage stage = Stage::kOpening;
  StartLists lists;
  DeviceReadiness device;
  std::string server;  ///< in brief; empty without one
  bool server_away = false;
  LessonChoice choice;       ///< the preselection; of a lesson, its choice
  std::string preparing;     ///< the step, for a person
  std::string trouble;       ///< why the last attempt to begin failed
  std::uint64_t lesson = 0;  ///< counts up; 0: none yet
  std::shared_ptr<const LessonBeginning> beginning;
  LessonStatus status;
  AidList aids;                        ///< that hold now
  std::string aids_by;                 ///< who changed them; empty: the exercise's own
  std::vector<BoardMessage> messages;  ///< the newest 50
  std::shared_ptr<const LessonOutcome> outcome;
  std::optional<SuggestedExercise> next;
};

/// A person's request to the station.
struct BoardRequest {
  enum class Kind : std::uint8_t {
    kNothing,
    kBegin,  ///< `choice`
    kStart,  ///< to the Start screen
    kLook,   ///< for exercises, trainees and the device once more
    kQuit,
  };
  Kind kind = Kind::kNothing;
  LessonChoice choice;
};

/// Thread: any but the haptic one. The window can hold up nobody: samples wait in a queue of `most_pieces`
/// (the oldest are dropped and counted), and no lock is held for longer than a copy.
class LessonBoard final : public LessonObserver {
 public:
  explicit LessonBoard(std::size_t most_pieces = 500) : most_pieces_(most_pieces) {}

  // --- the window's thread
  /// Copies the state when it is newer than `seen`, which becomes its number.
  bool look(BoardState& state, std::uint64_t& seen) const;
  /// Moves the new samples of `lesson` to the end of `samples`, oldest first; returns how many samples were
  /// dropped before them since the last call.
  std::uint64_t takeSamples(std::uint64_t lesson, std::vector<GestureSample>& samples);
  /// The newest request counts; kQuit stays.
  void ask(BoardRequest request);

  // --- the station's threads
  BoardRequest waitForRequest(std::chrono::milliseconds patience);
  /// Whether a request waits, without taking it.
  [[nodiscard]] bool requestWaits() const;
  /// `change` alters a BoardState&.
  template <typename Change>
  void change(Change&& change) {
    const std::scoped_lock lock(mutex_);
    change(state_);
    ++revision_;
  }
  [[nodiscard]] std::uint64_t droppedPieces() const;

  void preparing(const std::string& what) override;
  void began(std::shared_ptr<const LessonBeginning> beginning) override;
  void status(const LessonStatus& status) override;
  void aids(const ChosenAids& chosen) override;
  void concluding() override;
  void message(const std::string& from, const std::string& text) override;
  void nextExercise(const std::string& from, const std::string& exercise_id) override;
  void piece(const SamplePiece& piece) override;

 private:
  struct Waiting {
    std::shared_ptr<const std::vector<GestureSample>> samples;
    std::uint64_t lesson = 0;
  };
  const std::size_t most_pieces_;
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
