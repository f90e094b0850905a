/// The Start screen's logic: lists of exercises and trainees, device state, choice, and readiness for a
/// lesson. No drawing.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "client/net/spool/lesson_cache.h"
#include "client/net/spool/spool.h"
#include "client/station/run/io/options.h"
#include "client/station/run/lesson/ladder.h"
#include "client/station/run/lesson/list_exercises.h"
#include "client/station/window/lessons/lesson_board.h"
#include "common/base/time/clock.h"

namespace needlelab {

/// Returns the lists without a server: exercises, trainees and standings from the cache, names from the
/// command line and the spool's sessions. On a computer that practises alone, the built-in exercises.
StartLists localLists(const StationOptions& options, const Spool& spool);
/// Adds the server's exercises and trainees, and the standing of `trainee` (empty: none). Errors: from `ask`;
/// `lists` is then unchanged.
Status addServerLists(StartLists& lists, const std::vector<CachedLesson>& cached, const std::string& trainee,
                      const AskServer& ask, std::int64_t now_unix_ns);
/// Asks for the standing of `trainee` alone. Errors: as addServerLists.
Status addStanding(StartLists& lists, const std::string& trainee, const AskServer& ask,
                   std::int64_t now_unix_ns);

/// Returns the state of the `--device` device. Sets `hangs` if its driver does not return. Takes up to 3 s.
DeviceReadiness deviceReadiness(const StationOptions& options, bool steered, bool& hangs);

struct ExerciseRow {
  LessonChoice choice;  ///< the exercise, or the profile's file
  std::string name;     ///< display name
  std::string description;
  std::string note;  ///< its state and dates, "assigned", or why it is unusable
  bool usable = true;
  std::string heading = {};  ///< of the section that begins here; empty: the section continues
  int number = 0;            ///< of the step in its course, from 1; 0: none
  StepState state = StepState::kUnknown;
  DueState due = DueState::kNone;
};

/// Lists and choice. The person's choice survives changes of the lists, and an exercise that a person chose
/// here stays for another trainee, until a lesson begins. The question for the chosen trainee's
/// code comes from the server, or from the station itself if the server has asked for this trainee's code
/// before; the station's own may be left unanswered. Choosing another trainee removes the question and what
/// was typed.
class StartChoice {
 public:
  StartChoice() = default;
  ~StartChoice() { forgetCode(); }
  StartChoice(const StartChoice&) = delete;
  StartChoice& operator=(const StartChoice&) = delete;

  /// Takes new lists and the station's preselection. Keeps the person's choice if possible.
  void update(const BoardState& state, std::int64_t now_unix_ns = wallNowNs());

  /// Exercises for the chosen trainee: the ladder; without the server's courses, assigned ones first, then by
  /// name. The ladder's next step is selected until a person chooses another one.
  [[nodiscard]] const std::vector<ExerciseRow>& exercises() const { return exercises_; }
  /// Accounts, in the order of the shown names; of those typed by `typeTrainee`, the ones that fit.
  [[nodiscard]] const std::vector<std::string>& trainees() const { return trainees_; }
  [[nodiscard]] const std::string& trainee() const { return trainee_; }
  /// Returns the name to show for an account: the full name, if the server gave it.
  [[nodiscard]] std::string shown(const std::string& account) const;
  /// Returns "as of 2026-11-24 12:00" if the shown standing is not current; empty otherwise.
  [[nodiscard]] std::string asOf() const;
  /// Returns the trainee whose standing to request from the server now; empty: none.
  [[nodiscard]] std::string standingWanted() const;
  /// −1: none.
  [[nodiscard]] int exercise() const;
  /// `name`: an account or a shown name.
  void chooseTrainee(const std::string& name);
  /// Chooses the trainee of this name, in capitals or not, and lists only those in whose account
  /// or shown name the text is. `by_key`: typed without entering the field; where trainees have codes, it
  /// must then be a listed one, because a badge reader types, too.
  void typeTrainee(const std::string& text, bool by_key);
  /// Lists all trainees again.
  void showAllTrainees();
  /// Returns the text of `typeTrainee` that the list follows; empty: it has all trainees.
  [[nodiscard]] const std::string& typedName() const { return typed_name_; }
  /// Returns whether a text typed by keys may be a badge: no trainee is listed by it.
  [[nodiscard]] bool mayBeBadge() const;
  void chooseExercise(int index);
  /// Moves the choice by one, as the arrow keys do; without a choice, selects the first.
  void step(int by);
  /// Likewise for the list of trainees.
  void stepTrainee(int by);

  /// Returns the question for the chosen trainee's code; null: none, or the server is away and cannot check a
  /// code.
  [[nodiscard]] const CodeQuestion* codeQuestion() const;
  /// Takes what is typed as the answer.
  void typeCode(std::string code);
  [[nodiscard]] const std::string& typedCode() const { return code_; }
  /// Returns what was typed, for the request, and forgets it.
  [[nodiscard]] std::string takeCode();

  /// Returns the lesson to begin; none while the choice is incomplete.
  [[nodiscard]] std::optional<LessonChoice> choice() const;
  /// Returns why no lesson can begin, for a person; empty if one can.
  [[nodiscard]] std::string missing() const;

 private:
  void list();
  void takeQuestion(const std::optional<CodeQuestion>& question);
  void askInAdvance();
  [[nodiscard]] bool asksWithoutServer() const;
  void forgetCode();
  void addLadder();
  void addOthers();
  [[nodiscard]] const TraineeStanding* standing() const;

  StartLists lists_;
  bool server_ = false, server_away_ = false;
  std::int64_t now_unix_ns_ = 0;
  LessonChoice preselected_;
  std::string trainee_;
  std::string exercise_;  // id; empty: the profile or none
  bool by_profile_ = false;
  bool by_person_ = false;             // chosen by a person, not the ladder's next step
  std::optional<std::string> chosen_;  // by a person on this screen; kept for another trainee
  std::uint64_t lesson_ = 0;           // the last that began
  std::string typed_name_;
  bool typed_by_key_ = false;
  std::optional<CodeQuestion> question_;  // of trainee_
  std::uint64_t last_question_ = 0;
  std::uint64_t own_questions_ = 0;
  std::string code_;  // as typed
  std::vector<std::string> trainees_;
  std::vector<ExerciseRow> exercises_;
};

/// Returns the exercise's name if the lists have it, otherwise its id.
std::string exerciseName(const StartLists& lists, const std::string& id);

}  // namespace needlelab
