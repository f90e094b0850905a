/// The instructor's commands to a station, and their outcome. The server's audit log has all of them.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "client/instructor/model/lab_connection.h"
#include "client/instructor/model/notices.h"
#include "common/profile/aid_list.h"

namespace needlelab {

/// Each call ends in a notice: the station has read it, or the reason why not. Thread: the one
/// that polls `connection`.
class StationCommands {
 public:
  StationCommands(LabConnection& connection, Notices& notices) : connection_(connection), notices_(notices) {}

  void message(const std::string& station, const std::string& text);
  /// A remark at a tick of a session, open or closed. `done` runs once it is kept.
  void annotate(const std::string& session_id, std::uint64_t tick, const std::string& text,
                std::function<void()> done = {});
  void nextExercise(const std::string& station, const std::string& exercise_id);
  /// In this session only; `aids` replaces what is on.
  void setAids(const std::string& station, const std::string& session_id, const AidList& aids);
  void resetAids(const std::string& station, const std::string& session_id);
  void stopLesson(const std::string& station, const std::string& session_id, const std::string& reason);

  /// Requests that wait for an answer.
  [[nodiscard]] std::size_t waiting() const { return *waiting_; }

 private:
  void ask(const pb::Request& request, std::string done_words, std::function<void()> done = {});
  LabConnection& connection_;
  Notices& notices_;
  std::shared_ptr<std::size_t> waiting_ = std::make_shared<std::size_t>(0);
};

}  // namespace needlelab
