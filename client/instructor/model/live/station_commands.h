/// The instructor's commands to a station and their outcome. The server's audit log records all of them.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "client/instructor/model/live/lab_connection.h"
#include "client/instructor/model/live/notices.h"
#include "common/profile/aid_list.h"

namespace needlelab {

/// Each call ends in a notice: the station has read the command, or why it failed. Thread: the one that polls
/// `connection`.
class StationCommands {
 public:
  StationCommands(LabConnection& connection, Notices& notices) : connection_(connection), notices_(notices) {}

  /// Returns whether it was sent. If not, the caller keeps the typed text.
  bool message(const std::string& station, const std::string& text);
  /// Adds a remark at a tick of an open or closed session. `done` runs when the server has stored it. Returns
  /// whether it was sent.
  bool annotate(const std::string& session_id, std::uint64_t tick, const std::string& text,
                std::function<void()> done = {});
  /// `exercise`: its name, for the notice.
  void nextExercise(const std::string& station, const std::string& exercise_id, const std::string& exercise);
  /// Replaces the aids for this session only.
  void setAids(const std::string& station, const std::string& session_id, const AidList& aids);
  void resetAids(const std::string& station, const std::string& session_id);
  void stopLesson(const std::string& station, const std::string& session_id, const std::string& reason);

  /// Number of unanswered requests.
  [[nodiscard]] std::size_t waiting() const { return *waiting_; }

 private:
  bool ask(const pb::Request& request, std::string done_words, std::function<void()> done = {});
  LabConnection& connection_;
  Notices& notices_;
  std::shared_ptr<std::size_t> waiting_ = std::make_shared<std::size_t>(0);
};

}  // namespace needlelab
