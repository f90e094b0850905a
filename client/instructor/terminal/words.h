/// What an instructor has to say from the command line, each thing once and as soon as it can be said.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "client/instructor/terminal/options.h"
#include "common/base/result.h"
#include "needlelab/control.pb.h"

namespace needlelab {

/// Thread: one.
class Words {
 public:
  /// Asks the server.
  using Ask = std::function<Result<pb::Reply>(const pb::Request&)>;
  /// Tells the person what became of one of them ("stop").
  using Tell = std::function<void(const std::string& what, bool ok, const std::string& text)>;

  /// `options` must be checked and outlive it.
  Words(const InstructorOptions& options, Ask ask, Tell tell);

  /// The station is online.
  void online();
  /// … and this lesson runs there.
  void lesson(const std::string& session_id);
  /// … and this is its newest tick.
  void moment(const std::string& session_id, std::uint64_t tick);
  /// The remark on a moment that the options name, of a session that they name: it need not run.
  void onStored();

  [[nodiscard]] bool allSaid() const { return waiting_.empty(); }
  /// The first that was refused.
  [[nodiscard]] const std::optional<Error>& refused() const { return refused_; }

 private:
  enum class When { kOnline, kInLesson, kAtMoment };
  struct Word {
    std::string what;
    When when;
    pb::Request request;
    std::string done;
  };
  void sayAll(When when, const std::function<void(pb::Request&)>& complete);
  void say(Word word);
  Result<std::uint64_t> tickAt(const std::string& session_id, double at_s) const;

  const InstructorOptions& options_;
  const Ask ask_;
  const Tell tell_;
  std::vector<Word> waiting_;
  std::optional<Error> refused_;
};

}  // namespace needlelab
