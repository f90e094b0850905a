/// Where the station's threads and the window's thread meet: what is to be shown, and what a person asks for.
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

#include "client/station/run/lesson_audience.h"
#include "client/station/run/list_exercises.h"
#include "common/gesture/sample.h"

namespace needlelab {

/// Where the station is.
enum class Stage : std::uint8_t {
  kOpening,     ///< the spool is being opened
  kStart,       ///< who practises what?
  kPreparing,   ///< a lesson was asked for
  kLesson,      ///< the loop runs
  kConcluding,  ///< it has ended; the recording is being put away and scored
  kEnd,         ///< the outcome is there
  kClosing,     ///< the program ends
  kFailed,      ///< it cannot go on; `trouble` says why
};

/// Who to practise, and what.
struct LessonChoice {
  std::string trainee, exercise;
  bool by_profile = false;  ///< --profile's file in place of an exercise
  friend bool operator==(const LessonChoice&, const LessonChoice&) = default;
};

/// The Start screen's lists.
struct LessonOffers {
  std::vector<ListedExercise> exercises;                      ///< by id
  std::vector<ServerExercise> descriptions;                   ///< of those that the server has
  std::vector<std::string> trainees;                          ///< names that are known here
  std::vector<std::pair<std::string, std::string>> assigned;  ///< trainee, exercise
  std::string profile_file;                                   ///< --profile; empty: none
};

/// How the chosen device is before a lesson.
struct DeviceNews {
  std::string name, state;
  bool ready = false;
  bool known = false;  ///< false: not looked at yet
};

struct BoardMessage {
  std::string from, text;
  std::int64_t unix_ns = 0;
  double lesson_s = -1;  ///< in the lesson at that time; −1 outside of one
};

/// What an instructor wants next.
struct NextOffer {
  std::string from, exercise;
};

/// All but the samples. A copy is cheap.
struct BoardState {
  Stage stage = Stage::kOpening;
  LessonOffers offers;
  DeviceNews device;
  std::string server;  ///< in few words; empty without one
  bool server_away = false;
  LessonChoice choice;       ///< what is preselected, and of a lesson what it is
  std::string preparing;     ///< words
  std::string trouble;       ///< why the last attempt to begin failed
  std::uint64_t lesson = 0;  ///< counts up; 0: none yet
  std::shared_ptr<const LessonBeginning> beginning;
  LessonStanding standing;
  AidList aids;                        ///< that hold now
  std::string aids_by;                 ///< who changed them; empty: the exercise's own
  std::vector<BoardMessage> messages;  ///< the newest 50
  std::shared_ptr<const LessonOutcome> outcome;
  std::optional<NextOffer> next;
};

/// What a person asks of the station.
struct BoardWish {
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
class LessonBoard final : public LessonAudience {
 public:
  explicit LessonBoard(std::size_t most_pieces = 500) : most_pieces_(most_pieces) {}

  // --- the window's thread
  /// Copies the state when it is newer than `seen`, which becomes its number.
  bool look(BoardState& state, std::uint64_t& seen) const;
  /// Moves what has come of the lesson `lesson` to the end of `samples`, oldest first; gives how many samples
  /// were dropped before them since the last call.
  std::uint64_t takeSamples(std::uint64_t lesson, std::vector<GestureSample>& samples);
  /// The newest wish counts; kQuit stays.
  void ask(BoardWish wish);

  // --- the station's threads
  BoardWish waitForWish(std::chrono::milliseconds patience);
  /// Whether there is a wish, without taking it.
  [[nodiscard]] bool wishWaits() const;
  /// `change` alters a BoardState&.
  template <typename Change>
  void change(Change&& change) {
    const std::scoped_lock lock(mutex_);
    change(state_);
    ++revision_;
  }
  [[nodiscard]] std::uint64_t droppedPieces() const;

  void said(const std::string& line) override;
  void preparing(const std::string& what) override;
  void began(std::shared_ptr<const LessonBeginning> beginning) override;
  void stands(const LessonStanding& standing) override;
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
  std::condition_variable wished_;
  BoardState state_;
  std::uint64_t revision_ = 1;
  BoardWish wish_;
  bool quit_ = false;
  std::deque<Waiting> pieces_;
  std::uint64_t dropped_ = 0, dropped_since_ = 0;
};

}  // namespace needlelab
