/// One or two stored sessions: replayed, compared, run again, scored, exported. A worker does what takes
/// long; the view polls.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "client/instructor/model/comparison.h"
#include "client/instructor/model/lab_connection.h"
#include "client/instructor/model/notices.h"
#include "client/instructor/model/replay_player.h"
#include "client/instructor/model/report.h"
#include "client/instructor/model/rerun.h"
#include "client/instructor/model/stored_gesture.h"
#include "client/instructor/model/worker.h"

namespace needlelab {

/// Which session: an id (text or 16 bytes), "newest" (of the closed ones), "previous" (the one before), or
/// "reference" (the first expert's of the first session's exercise).
using SessionChoice = std::string;

/// Thread: one, that polls `connection`.
class SessionAnalysis {
 public:
  SessionAnalysis(LabConnection& connection, Notices& notices, ScenePreparer prepare);
  ~SessionAnalysis();

  /// Takes in finished jobs. Call it once a frame.
  void poll();

  void loadFirst(const SessionChoice& which);
  /// Loads another one beside the first.
  void loadSecond(const SessionChoice& which);
  void dropSecond();
  /// Loads both, then compares them.
  void loadBoth(const SessionChoice& first, const SessionChoice& second, Alignment alignment);
  /// Compares the two that are loaded.
  void compare(Alignment alignment);
  /// Runs the engine on the first one. `profile_id`: the server's newest revision; "own" or empty: the
  /// session's profile.
  void rerun(const std::string& profile_id, const std::string& axial_model);
  void dropRerun() { rerun_.reset(); }
  /// Reads the first one's score, reference and progress.
  void collect();
  /// Exports the first one, by the end of the name: .html (report), .csv (samples).
  void exportTo(const std::filesystem::path& file);
  /// Reads the first one's remarks again, after one was added.
  void readRemarks();

  [[nodiscard]] const std::shared_ptr<const StoredGesture>& first() const { return first_; }
  [[nodiscard]] const std::shared_ptr<const StoredGesture>& second() const { return second_; }
  [[nodiscard]] const std::vector<pb::Annotation>& remarks() const { return remarks_; }  ///< of the first one
  [[nodiscard]] const std::optional<GestureComparison>& comparison() const { return comparison_; }
  [[nodiscard]] const std::shared_ptr<const Rerun>& rerunResult() const { return rerun_; }
  [[nodiscard]] const std::optional<ReportData>& report() const { return report_; }
  [[nodiscard]] const std::string& trouble() const { return trouble_; }  ///< of the last job; empty: none
  [[nodiscard]] std::string doing() const { return worker_.doing(); }
  [[nodiscard]] bool busy() const { return worker_.busy(); }
  [[nodiscard]] double loadedShare() const;  ///< 0-1, of the session that is being loaded

  ReplayPlayer player;

 private:
  using Loaded = Result<std::shared_ptr<const StoredGesture>>;
  Loaded load(const SessionChoice& which, const std::function<bool()>& stopped);
  Result<std::string> idOf(const SessionChoice& which, const LabCall& call) const;
  void takeFirst(std::shared_ptr<const StoredGesture> gesture);
  void showError(const Error& error);
  LabCall caller(const std::function<bool()>& stopped);

  LabConnection& connection_;
  Notices& notices_;
  const ScenePreparer prepare_;
  std::shared_ptr<const StoredGesture> first_, second_;
  std::vector<pb::Annotation> remarks_;
  std::optional<GestureComparison> comparison_;
  std::shared_ptr<const Rerun> rerun_;
  std::optional<ReportData> report_;
  std::string trouble_;
  LoadProgress progress_;
  Worker worker_;  // last: it ends before what its jobs use
};

}  // namespace needlelab
