/// The model of the instructor's window: the connection, the overview of the lab, the station that is looked
/// over, the sessions that are analysed. Screens and scripts show it and call it.
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
#include "common/base/result.h"

namespace needlelab {

/// The screen that the window shows.
enum class WindowScreen : std::uint8_t { kLogin, kLab, kLive, kSessions, kReplay, kCompare, kRerun, kScores };

/// The fields of the log-in screen, as typed.
struct LoginForm {
  std::string server = "127.0.0.1:7750", ca_file, user, password;
};

/// An exercise as one chooses it.
struct ExerciseChoice {
  std::string id, name;
};

/// Thread: one. Nothing here waits for the network or the disk.
class LabState {
 public:
  explicit LabState(ScenePreparer prepare = {}, LabConnectionSettings settings = {});
  ~LabState();

  /// Takes in the news. Call it once a frame, before drawing; `now_s` ascends.
  void update(double now_s);
  /// The frame is on the screen.
  void presented(std::int64_t now_unix_ns);

  // --- log-in
  LoginForm form;
  std::string form_trouble;  ///< what is wrong with the form itself; empty: nothing
  void logIn();
  void logOut();
  [[nodiscard]] const LinkState& link() const { return link_; }
  /// Logged in now or at some time: the lab is shown, a lost connection does not take it away.
  [[nodiscard]] bool inside() const { return inside_; }

  // --- the lab
  LabOverview overview;
  TileOrder order = TileOrder::kNeed;
  TileFilter filter;
  [[nodiscard]] const std::vector<ExerciseChoice>& exercises() const { return exercises_; }
  [[nodiscard]] const std::vector<std::string>& profiles() const { return profiles_; }  ///< ids

  // --- looking over a shoulder
  void open(const std::string& station);
  /// Null: none is looked over.
  [[nodiscard]] LiveStation* live() { return live_.get(); }
  /// A remark at the moment that is shown, live or in the replay.
  void annotate(const std::string& text);
  /// The aids of the trainee who is looked over: as they were set here in this session, else those of the
  /// exercise.
  [[nodiscard]] AidList aidsNow() const;
  void setAids(const AidList& aids);
  void resetAids();

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
  void askForScene();
  LinkState link_;
  bool inside_ = false;
  LinkPhase phase_before_ = LinkPhase::kLoggedOut;
  double now_s_ = 0, last_s_ = 0;
  std::unique_ptr<LiveStation> live_;
  std::vector<ExerciseChoice> exercises_;
  std::map<std::string, AidList> exercise_aids_;
  std::optional<AidList> aids_;  // as set here, of aids_session_
  std::string aids_session_;
  std::vector<std::string> profiles_;
  std::shared_ptr<int> alive_ = std::make_shared<int>(0);
};

/// Fills the fields of `form` that the file has: server, CA file, name. A missing or unreadable file changes
/// nothing.
void recallLogin(const std::filesystem::path& file, LoginForm& form);
/// Writes those fields, never the password, for the owner only. Errors: the disk's.
Status rememberLogin(const std::filesystem::path& file, const LoginForm& form);

}  // namespace needlelab
