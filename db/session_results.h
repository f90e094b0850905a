/// What is made of a recorded session: its scores and the references they are compared with, its aspirations
/// and injections, the instructors' remarks.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/base/uuid.h"
#include "db/connection.h"
#include "needlelab/event.pb.h"
#include "needlelab/teaching.pb.h"

namespace needlelab {

/// Scores, each under the version of the definitions that it was made with.
/// Functions on a connection, which it does not own. Thread: as its Connection; changes need the writer's and
/// a transaction.
class ScoreStore {
 public:
  explicit ScoreStore(Connection& connection) : connection_(connection) {}

  /// Stores it. The first one of a session becomes its score for ever (`first`, SessionInfo.score_json, the
  /// attempt's verdict); one of the same version is replaced, unless it is the first: that one stays, and
  /// this does nothing. `first` of the argument is not read. kNotFound: no such session; kUnavailable: its
  /// person was erased; kInvalidInput: version 0.
  Status put(const pb::Score& score);
  /// `version` 0: the newest. kNotFound.
  Result<pb::Score> get(const Uuid& session, std::uint32_t version);
  /// All of a session, by version.
  Result<std::vector<pb::Score>> list(const Uuid& session);

 private:
  Connection& connection_;
};

/// The sessions of experts that an exercise is compared with. Thread: as ScoreStore.
class ReferenceStore {
 public:
  explicit ReferenceStore(Connection& connection) : connection_(connection) {}

  /// The next revision, without bands. `base`: the revision that the choice was made from, else kConflict.
  /// kNotFound: the exercise or a session does not exist; kInvalidInput: a session of another exercise, twice
  /// the same, not closed, too many.
  Result<pb::Reference> put(const std::string& exercise_id, const std::vector<Uuid>& sessions,
                            std::uint32_t base, const std::string& by, std::int64_t now_unix_ns);
  /// The newest; revision 0 and no sessions when none was chosen.
  Result<pb::Reference> get(std::string_view exercise_id);

 private:
  Connection& connection_;
};

/// Aspirations and injections of closed sessions.
/// Functions on a connection, which it does not own. Thread: as its Connection; changes need the writer's and
/// a transaction.
class EventStore {
 public:
  explicit EventStore(Connection& connection) : connection_(connection) {}

  /// Stores all events of a session; an empty list says that it has none. Once for a session: a second call
  /// changes nothing. Errors: kNotFound (session), kInvalidInput (the session is open).
  Status put(const Uuid& session, std::span<const pb::SyringeEvent> events);
  /// In order of time; nothing when put() was never called. kNotFound: unknown session.
  Result<std::optional<std::vector<pb::SyringeEvent>>> list(const Uuid& session);

 private:
  Connection& connection_;
};

/// A remark of an instructor on a tick of a session.
struct StoredAnnotation {
  std::uint64_t id = 0;
  Uuid session{};
  std::uint64_t tick = 0;
  std::string text;
  std::string author;
  std::int64_t created_unix_ns = 0;
};

/// Functions on a connection, which it does not own. Thread: as its Connection; changes need the writer's.
class AnnotationStore {
 public:
  explicit AnnotationStore(Connection& connection) : connection_(connection) {}

  /// Gives the new id; `annotation.id` is not read. Errors: kInvalidInput (text), kNotFound (session).
  Result<std::uint64_t> add(const StoredAnnotation& annotation);
  /// By tick. kNotFound: unknown session.
  Result<std::vector<StoredAnnotation>> list(const Uuid& session);

 private:
  Connection& connection_;
};

}  // namespace needlelab
