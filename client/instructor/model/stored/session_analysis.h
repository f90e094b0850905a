/// Analysis of one or two stored sessions: replay, comparison, re-run, score, export. A worker runs the long
/// jobs; the view polls.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "client/instructor/model/live/lab_connection.h"
#include "client/instructor/model/live/notices.h"
#include "client/instructor/model/stored/comparison.h"
#include "client/instructor/model/stored/replay_player.h"
#include "client/instructor/model/stored/report.h"
#include "client/instructor/model/stored/rerun.h"
#include "client/instructor/model/stored/stored_gesture.h"
#include "client/instructor/model/stored/worker.h"

namespace needlelab {

/// A session: its id (text or 16 bytes), "newest" (closed session), "previous" (the one before that), or
/// "reference" (the first expert session for the first session's exercise).
using SessionChoice = std::string;

/// Kinds of jobs, by the screen that shows their result.
enum class AnalysisJob : std::uint8_t { kNone, kLoad, kCompare, kRerun, kScore, kExport, kRemarks };

/// Thread: the one that polls `connection`.
class SessionAnalysis {
 public:
  SessionAnalysis(LabConnection& connection, Notices& notices, ScenePreparer prepare);
  ~SessionAnalysis();

  /// Takes the results of finished jobs. Call once per frame.
  void poll();

  void loadFirst(const SessionChoice& which);
  /// Loads another session to compare with the first.
  void loadSecond(const SessionChoice& which);
  void dropSecond();
  /// Loads both, then compares them.
  void loadBoth(const SessionChoice& first, const SessionChoice& second, Alignment alignment);
  /// Compares the two loaded sessions.
  void compare(Alignment alignment);
  /// Runs the engine on the first session. `profile_id`: uses the server's newest revision; "own" or empty:
  /// the session's profile.
  void rerun(const std::string& profile_id, const std::string& axial_model);
  void dropRerun() { rerun_.reset(); }
  /// Reads the first session's score, reference and progress.
  void collect();
  /// Exports the first session; the file extension sets the format: .html (report), .csv (samples).
  void exportTo(const std::filesystem::path& file);
  /// Reloads the first session's remarks after one was added.
  void readRemarks();

  [[nodiscard]] const std::shared_ptr<const StoredGesture>& first() const { return first_; }
  [[nodiscard]] const std::shared_ptr<const StoredGesture>& second() const { return second_; }
  [[nodiscard]] const std::vector<pb::Annotation>& remarks() const {
    return remarks_;
  }  ///< of the first session
  [[nodiscard]] const std::optional<GestureComparison>& comparison() const { return comparison_; }
  [[nodiscard]] const std::shared_ptr<const Rerun>& rerunResult() const { return rerun_; }
  [[nodiscard]] const std::optional<ReportData>& report() const { return report_; }
  [[nodiscard]] const std::string& trouble() const {
    return trouble_;
  }  ///< error of the last job; empty: none
  /// Like trouble() if that job was of this kind, else empty: a screen does not show another screen's error.
  [[nodiscard]] std::string troubleOf(AnalysisJob job) const {
    return job == job_ ? trouble_ : std::string();
  }
  [[nodiscard]] std::string doing() const { return worker_.doing(); }
  [[nodiscard]] bool busy() const { return worker_.busy(); }
  [[nodiscard]] double loadedShare() const;  ///< loaded fraction of a session, 0-1

  ReplayPlayer player;

 private:
  using Loaded = Result<std::shared_ptr<const StoredGesture>>;
  Loaded load(const SessionChoice& which, const std::function<bool()>& stopped);
  Result<std::string> idOf(const SessionChoice& which, const LabCall& call) const;
  void takeFirst(std::shared_ptr<const StoredGesture> gesture);
  void begin(AnalysisJob job);
  void showError(AnalysisJob job, const Error& error);
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
  AnalysisJob job_ = AnalysisJob::kNone;  // the job of trouble_
  LoadProgress progress_;
  Worker worker_;  // last, so that it is destroyed before the data that its jobs use
};

}  // namespace needlelab
