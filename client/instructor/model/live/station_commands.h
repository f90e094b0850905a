/// The instructor's commands to a station and their outcome. The server's audit log records all of them.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "client/instructor/model/live/lab_connection.h"
#include "client/instructor/model/live/notices.h"
#include "common/profile/aid_list.h"

namespace needlelab {

/// A station, and the lesson that runs there; an empty session: none.
struct Addressee {
  std::string station, session_id;
  friend bool operator==(const Addressee&, const Addressee&) = default;
};

/// Those with a lesson.
inline std::vector<Addressee> lessonsOf(std::vector<Addressee> to) {
  std::erase_if(to, [](const Addressee& each) { return each.session_id.empty(); });
  return to;
}

/// Each call ends in one notice: how many stations have read the command, and why some did not. Thread: the
/// one that polls `connection`.
class StationCommands {
 public:
  StationCommands(LabConnection& connection, Notices& notices) : connection_(connection), notices_(notices) {}

  /// Returns whether it was sent. If not, the caller keeps the typed text.
  bool message(const std::vector<Addressee>& to, const std::string& text);
  /// Adds a remark at a tick of an open or closed session. `done` runs when the server has stored it. Returns
  /// whether it was sent.
  bool annotate(const std::string& session_id, std::uint64_t tick, const std::string& text,
                std::function<void()> done = {});
  /// `exercise`: its name, for the notice.
  void nextExercise(const std::vector<Addressee>& to, const std::string& exercise_id,
                    const std::string& exercise);
  /// Replaces the aids for these sessions only.
  void setAids(const std::vector<Addressee>& to, const AidList& aids);
  void resetAids(const std::vector<Addressee>& to);
  void stopLessons(const std::vector<Addressee>& lessons, const std::string& reason);

  /// Number of unanswered requests.
  [[nodiscard]] std::size_t waiting() const { return *waiting_; }

 private:
  using Fill = std::function<void(const Addressee&, pb::Request&)>;
  /// One request to each; `done_words` for people, after "station-3: " or "7 stations: ".
  bool askEach(const std::vector<Addressee>& to, const Fill& fill, std::string done_words,
               std::function<void()> done = {});
  LabConnection& connection_;
  Notices& notices_;
  std::shared_ptr<std::size_t> waiting_ = std::make_shared<std::size_t>(0);
};

}  // namespace needlelab
