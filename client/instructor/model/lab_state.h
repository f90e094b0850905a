/// The model of the instructor's window: connection, lab overview, the watched station, and the analysed
/// sessions. Screens and scripts read and call it.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "client/instructor/model/live/depth_picture.h"
#include "client/instructor/model/live/lab_connection.h"
#include "client/instructor/model/live/lab_overview.h"
#include "client/instructor/model/live/live_station.h"
#include "client/instructor/model/live/notices.h"
#include "client/instructor/model/live/station_commands.h"
#include "client/instructor/model/stored/session_analysis.h"
#include "client/instructor/model/stored/session_search.h"
#include "client/view/model/screen_actions.h"
#include "common/base/result.h"

namespace needlelab {

/// The window's current screen.
enum class WindowScreen : std::uint8_t { kLogin, kLab, kLive, kSessions, kReplay, kCompare, kRerun, kScores };

/// Fields of the log-in screen, as typed. `server` may name several (common/wire/endpoint.h).
struct LoginForm {
  std::string server = "127.0.0.1:7750", ca_file, user, password;
};

/// An exercise in a list for selection.
struct ExerciseChoice {
  std::string id, name;
};
/// A patient's profile in a list for selection.
struct ProfileChoice {
  std::string id, name;
};

/// Actions that the screens offer, as tables. Enter presses the highlighted button.
enum LabAct : int { kActLogIn, kActAdvice, kActSearch, kActStop, kActStopNow, kActGoOn, kActReconnect };
std::vector<ScreenAction> loginActions(bool busy);
/// The button that leads out of an empty screen.
ScreenAction adviceAction(std::string label);
/// `advised`: the screen is empty, so Enter belongs to its advice button.
std::vector<ScreenAction> searchActions(bool advised);
/// "Stop lesson …", then its confirmation. Without lessons it cannot be pressed.
std::vector<ScreenAction> stopActions(bool asking, std::size_t lessons = 1);
/// Banner over every screen while the connection is lost or refused. No key: Enter belongs to the screen.
std::vector<ScreenAction> linkActions(LinkPhase phase);

/// Confirmation before stopping lessons. It is bound to them: an answer never reaches another one.
class StopQuestion {
 public:
  void ask(std::vector<Addressee> lessons) { lessons_ = std::move(lessons); }
  /// Withdraws the question unless it is about just these lessons.
  void keepOnlyFor(const std::vector<Addressee>& lessons) {
    if (lessons != lessons_) withdraw();
  }
  void withdraw() { *this = StopQuestion(); }
  [[nodiscard]] bool asking() const { return !lessons_.empty(); }
  std::string reason;  ///< for the trainees, as typed

 private:
  std::vector<Addressee> lessons_;
};

/// Thread: one. No call blocks on the network or the disk.
class LabState {
 public:
  explicit LabState(ScenePreparer prepare = {}, LabConnectionSettings settings = {});
  ~LabState();

  /// Processes the news. Call it once per frame, before drawing; `now_s` ascends.
  void update(double now_s);
  /// Call when the frame is on the screen.
  void presented(std::int64_t now_unix_ns);

  // --- log-in
  LoginForm form;
  std::string form_trouble;  ///< error in the form itself; empty: none
  void logIn();
  void logOut();
  [[nodiscard]] const LinkState& link() const { return link_; }
  /// Returns whether the user has ever logged in; then the lab stays visible when the connection is lost.
  [[nodiscard]] bool inside() const { return inside_; }

  // --- the lab
  LabOverview overview;
  TileFilter filter;
  /// The stations that a command goes to: those that were chosen and are still there.
  std::set<std::string> chosen;
  [[nodiscard]] std::vector<Addressee> addressees() const;
  /// The tissues of an exercise that is practised now; null until the server sent them.
  [[nodiscard]] const DepthPicture* depthPicture(const std::string& exercise) const;
  [[nodiscard]] const std::vector<ExerciseChoice>& exercises() const { return exercises_; }
  /// Returns the exercise's name, or its id if the server has not listed it (yet).
  [[nodiscard]] std::string exerciseName(const std::string& id) const;
  [[nodiscard]] const std::vector<ProfileChoice>& profiles() const { return profiles_; }

  // --- looking over a shoulder
  void open(const std::string& station);
  /// Returns the watched station; null: none.
  [[nodiscard]] LiveStation* live() { return live_.get(); }
  /// Adds a remark at the displayed moment, live or in the replay. Returns whether it was sent.
  bool annotate(const std::string& text);
  /// Whom the commands of the current screen reach: the watched station, or in the lab the chosen ones.
  [[nodiscard]] std::vector<Addressee> commanded() const;
  /// Returns the aids of the first of them: those set here in its session, otherwise the exercise's.
  [[nodiscard]] AidList aidsNow() const;
  /// Returns the requirements of the watched lesson's exercise; empty if unknown.
  [[nodiscard]] std::vector<PlotRequirement> requirementsNow() const;
  /// Returns that exercise's planned line in W; nullopt without a plan or while the scene is unknown.
  [[nodiscard]] std::optional<PlanView> planNow() const;
  void setAids(const AidList& aids);
  void resetAids();
  StopQuestion stop_question;  ///< about the watched lesson, or in the lab about those of the chosen stations

  WindowScreen screen = WindowScreen::kLogin;
  Notices notices;

 private:
  LabConnection connection_;
  ScenePreparer prepare_;

 public:
  StationCommands commands;
  SessionSearch sessions;
  SessionAnalysis analysis;

  [[nodiscard]] double now_s() const { return now_s_; }

 private:
  void readLists();
  /// Reads all exercises page by page and replaces the list at the end; keeps the old list on an error.
  void readExercises(std::string page = {}, std::vector<pb::Exercise> read = {});
  /// The watched lesson's exercise; null if unknown.
  [[nodiscard]] const pb::Exercise* exerciseNow() const;
  [[nodiscard]] const pb::Exercise* exerciseOf(const std::string& id) const;
  void requestScene();
  /// Of the lessons that have ended, for their tiles.
  void requestVerdicts();
  /// Of the exercises that are practised, for their tiles.
  void requestDepthPictures();
  LinkState link_;
  bool inside_ = false;
  LinkPhase phase_before_ = LinkPhase::kLoggedOut;
  std::string server_before_;  // of the last connection
  double now_s_ = 0, last_s_ = 0;
  std::unique_ptr<LiveStation> live_;
  std::vector<ExerciseChoice> exercises_;
  std::map<std::string, pb::Exercise> exercise_by_id_;
  std::map<std::string, AidList> aids_;  // set here, by session
  std::vector<ProfileChoice> profiles_;
  struct Pictured {
    std::optional<DepthPicture> picture;
    double asked_s = -1e9;
  };
  std::map<std::string, Pictured> depth_pictures_;  // by exercise
  std::shared_ptr<int> alive_ = std::make_shared<int>(0);
};

/// Fills `form` from the file: server, CA file, name. Changes nothing if the file is missing or unreadable.
void recallLogin(const std::filesystem::path& file, LoginForm& form);
/// Writes those fields, never the password, to a file that only the owner can read. Errors: from the disk.
Status rememberLogin(const std::filesystem::path& file, const LoginForm& form);

}  // namespace needlelab
