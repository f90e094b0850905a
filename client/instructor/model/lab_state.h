/// The model of the instructor's window: connection, lab overview, the watched station, and the analysed
/// sessions. Screens and scripts read and call it.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/instructor/model/lab_connection.h"
#include "client/instructor/model/lab_overview.h"
#include "client/instructor/model/live_station.h"
#include "client/instructor/model/notices.h"
#include "client/instructor/model/session_analysis.h"
#include "client/instructor/model/session_search.h"
#include "client/instructor/model/station_commands.h"
#include "client/view/model/screen_actions.h"
#include "common/base/result.h"

namespace needlelab {

/// The window's current screen.
enum class WindowScreen : std::uint8_t { kLogin, kLab, kLive, kSessions, kReplay, kCompare, kRerun, kScores };

/// The fields of the log-in screen, as typed. `server` may name several (common/wire/endpoint.h).
struct LoginForm {
  std::string server = "127.0.0.1:7750", ca_file, user, password;
};

/// An exercise in a list for selection.
struct ExerciseChoice {
  std::string id, name;
};
/// A patient's profile in such a list.
struct ProfileChoice {
  std::string id, name;
};

/// What the screens offer, as tables: Enter is the highlighted button.
enum LabAct : int { kActLogIn, kActAdvice, kActSearch, kActStop, kActStopNow, kActGoOn, kActReconnect };
std::vector<ScreenAction> loginActions(bool busy);
/// The way out of an empty screen.
ScreenAction adviceAction(std::string label);
/// `advised`: the screen is empty, and Enter is its way out.
std::vector<ScreenAction> searchActions(bool advised);
/// "Stop lesson …", and then its question.
std::vector<ScreenAction> stopActions(bool asking);
/// The banner over every screen while the connection is away or refused: without a key, because Enter is the
/// screen's own.
std::vector<ScreenAction> linkActions(LinkPhase phase);

/// The question whether to stop a lesson. It is about one lesson: an answer never reaches another one.
class StopQuestion {
 public:
  void ask(const LiveStation& live);
  /// Withdraws the question unless this station's present lesson is the one that it is about.
  void keepOnlyFor(const LiveStation* live);
  void withdraw();
  [[nodiscard]] bool asking() const { return asking_; }
  std::string reason;  ///< for the trainee, as typed

 private:
  bool asking_ = false;
  std::string station_, session_;
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
  /// Returns whether the user has ever logged in: the lab stays visible after a loss of the connection.
  [[nodiscard]] bool inside() const { return inside_; }

  // --- the lab
  LabOverview overview;
  TileOrder order = TileOrder::kNeed;
  TileFilter filter;
  [[nodiscard]] const std::vector<ExerciseChoice>& exercises() const { return exercises_; }
  /// Returns the exercise's name; its id if the server does not list it, or not yet.
  [[nodiscard]] std::string exerciseName(const std::string& id) const;
  [[nodiscard]] const std::vector<ProfileChoice>& profiles() const { return profiles_; }

  // --- looking over a shoulder
  void open(const std::string& station);
  /// Returns the watched station; null: none.
  [[nodiscard]] LiveStation* live() { return live_.get(); }
  /// Adds a remark at the displayed moment, live or in the replay. Returns whether it was sent.
  bool annotate(const std::string& text);
  /// Returns the watched trainee's aids: those set here in this session, otherwise the exercise's.
  [[nodiscard]] AidList aidsNow() const;
  /// Returns what the exercise of the watched lesson requires; nothing where it is not known.
  [[nodiscard]] std::vector<PlotRequirement> requirementsNow() const;
  /// Returns that exercise's planned line in W; nothing without a plan, and until the scene is known.
  [[nodiscard]] std::optional<PlanView> planNow() const;
  void setAids(const AidList& aids);
  void resetAids();
  StopQuestion stop_question;  ///< always about the watched lesson

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
  /// Reads all exercises page by page, and takes them in at the end; on an error keeps those of before.
  void readExercises(std::string page = {}, std::vector<pb::Exercise> read = {});
  /// The watched lesson's; null where it is not known.
  [[nodiscard]] const pb::Exercise* exerciseNow() const;
  void askForScene();
  LinkState link_;
  bool inside_ = false;
  LinkPhase phase_before_ = LinkPhase::kLoggedOut;
  std::string server_before_;  // of the last connection
  double now_s_ = 0, last_s_ = 0;
  std::unique_ptr<LiveStation> live_;
  std::vector<ExerciseChoice> exercises_;
  std::map<std::string, pb::Exercise> exercise_by_id_;
  std::optional<AidList> aids_;  // set here, for aids_session_
  std::string aids_session_;
  std::vector<ProfileChoice> profiles_;
  std::shared_ptr<int> alive_ = std::make_shared<int>(0);
};

/// Fills `form` from the file: server, CA file, name. Changes nothing if the file is missing or unreadable.
void recallLogin(const std::filesystem::path& file, LoginForm& form);
/// Writes those fields, never the password, to a file that only the owner can read. Errors: from the disk.
Status rememberLogin(const std::filesystem::path& file, const LoginForm& form);

}  // namespace needlelab
