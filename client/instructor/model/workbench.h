/// One or two stored sessions on the desk: replayed, compared, run again, scored, exported. What takes long
/// is done by a worker; the view polls.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "client/instructor/model/comparison.h"
#include "client/instructor/model/lab_connection.h"
#include "client/instructor/model/notices.h"
#include "client/instructor/model/replay_player.h"
#include "client/instructor/model/report_data.h"
#include "client/instructor/model/rerun.h"
#include "client/instructor/model/stored_gesture.h"
#include "client/instructor/model/worker.h"

namespace needlelab {

/// Which session: an id (text or 16 bytes), "newest" (of the closed ones), "previous" (the one before), or
/// "reference" (the first expert's of the first session's exercise).
using SessionChoice = std::string;

/// Thread: one, that polls `lab`.
class Workbench {
 public:
  Workbench(LabConnection& lab, Notices& notices, ScenePreparer prepare);
  ~Workbench();

  /// Runs what finished. Once a frame.
  void poll();

  void loadFirst(const SessionChoice& which);
  /// Beside the first one.
  void loadSecond(const SessionChoice& which);
  void dropSecond();
  /// Both, then compares them.
  void loadBoth(const SessionChoice& first, const SessionChoice& second, Alignment alignment);
  /// Of the two that are loaded.
  void compare(Alignment alignment);
  /// `profile_id`: newest revision of the server's; "own" or empty: the session's.
  void rerun(const std::string& profile_id, const std::string& axial_model);
  void dropRerun() { rerun_.reset(); }
  /// The first one's score, reference and progress.
  void collect();
  /// By the name's end: .html (report), .csv (samples). Of the first one.
  void exportTo(const std::filesystem::path& file);
  /// The first one was annotated: its remarks are read again.
  void readRemarks();

  [[nodiscard]] const std::shared_ptr<const StoredGesture>& first() const { return first_; }
  [[nodiscard]] const std::shared_ptr<const StoredGesture>& second() const { return second_; }
  [[nodiscard]] const std::vector<pb::Annotation>& remarks() const { return remarks_; }  ///< of the first one
  [[nodiscard]] const std::optional<GestureComparison>& comparison() const { return comparison_; }
  [[nodiscard]] const std::shared_ptr<const Rerun>& rerunResult() const { return rerun_; }
  [[nodiscard]] const std::optional<ReportData>& report() const { return report_; }
  [[nodiscard]] const std::string& trouble() const {
    return trouble_;
  }  ///< of the last thing asked; empty: none
  [[nodiscard]] std::string doing() const { return worker_.doing(); }
  [[nodiscard]] bool busy() const { return worker_.busy(); }
  [[nodiscard]] double loadedShare() const;  ///< 0-1, of what is being loaded

  ReplayPlayer player;

 private:
  using Loaded = Result<std::shared_ptr<const StoredGesture>>;
  Loaded load(const SessionChoice& which, const std::function<bool()>& stopped);
  Result<std::string> idOf(const SessionChoice& which, const LabCall& call) const;
  void takeFirst(std::shared_ptr<const StoredGesture> gesture);
  void say(const Error& error);
  LabCall caller(const std::function<bool()>& stopped);

  LabConnection& lab_;
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
