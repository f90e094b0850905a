/// Everything behind the instructor's window: the lab's line, the overview, the stations that are looked
/// over, the sessions on the desk. The screens show it and call it; scripts do the same.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/instructor/model/lab_connection.h"
#include "client/instructor/model/lab_overview.h"
#include "client/instructor/model/live_station.h"
#include "client/instructor/model/notices.h"
#include "client/instructor/model/session_search.h"
#include "client/instructor/model/talk.h"
#include "client/instructor/model/workbench.h"

namespace needlelab {

/// What the window shows.
enum class DeskScreen : std::uint8_t { kLogin, kLab, kLive, kSessions, kReplay, kCompare, kRerun, kScores };

/// What is typed into the log-in screen.
struct LoginForm {
  std::string server = "127.0.0.1:7750", ca_file, user, password;
};

/// An exercise as one chooses it.
struct ExerciseChoice {
  std::string id, name;
};

/// Thread: one. Nothing here waits.
class Desk {
 public:
  explicit Desk(ScenePreparer prepare = {}, LabConnectionSettings settings = {});
  ~Desk();

  /// Takes in what came. Once a frame, before it is drawn; `now_s` ascends.
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
  /// What the trainee who is looked over is shown: as it was set here in this session, else as the exercise
  /// has it.
  [[nodiscard]] AidList aidsNow() const;
  void setAids(const AidList& aids);
  void resetAids();

  DeskScreen screen = DeskScreen::kLogin;
  Notices notices;

 private:
  LabConnection lab_;
  ScenePreparer prepare_;

 public:
  Talk talk;
  SessionSearch sessions;
  Workbench bench;

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

}  // namespace needlelab
