/// Results of recorded sessions: scores and their references, aspirations and injections, instructors'
/// remarks.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/base/text/uuid.h"
#include "db/store/connection.h"
#include "needlelab/event.pb.h"
#include "needlelab/teaching.pb.h"

namespace needlelab {

/// Scores, one per version of the measures' definitions. Does not own the connection. Thread: as its
/// Connection; changes need the writer's and a transaction.
class ScoreStore {
 public:
  explicit ScoreStore(Connection& connection) : connection_(connection) {}

  /// Stores the score. A session's first score remains its official one (`first`, SessionInfo.score_json, the
  /// attempt's verdict). A later score replaces one of the same version; if that is the first score, nothing
  /// happens. Ignores `score.first`. kNotFound: no such session; kUnavailable: its person was erased;
  /// kInvalidInput: version 0.
  Status put(const pb::Score& score);
  /// `version` 0: the newest. kNotFound.
  Result<pb::Score> get(const Uuid& session, std::uint32_t version);
  /// All scores of a session, by version.
  Result<std::vector<pb::Score>> list(const Uuid& session);

 private:
  Connection& connection_;
};

/// Experts' sessions that serve as an exercise's reference. Thread: as ScoreStore.
class ReferenceStore {
 public:
  explicit ReferenceStore(Connection& connection) : connection_(connection) {}

  /// Stores the next revision, without bands. `base` must be the newest revision, else kConflict. kNotFound:
  /// the exercise or a session does not exist; kInvalidInput: a session belongs to another exercise, is
  /// listed twice or is not closed, or there are too many.
  Result<pb::Reference> put(const std::string& exercise_id, const std::vector<Uuid>& sessions,
                            std::uint32_t base, const std::string& by, std::int64_t now_unix_ns);
  /// The newest revision; revision 0 without sessions if none exists.
  Result<pb::Reference> get(std::string_view exercise_id);

 private:
  Connection& connection_;
};

/// Aspirations and injections of closed sessions. Does not own the connection. Thread: as its Connection;
/// changes need the writer's and a transaction.
class EventStore {
 public:
  explicit EventStore(Connection& connection) : connection_(connection) {}

  /// Stores all events of a session; an empty list means that it has none. Works once per session: a second
  /// call changes nothing. Errors: kNotFound (session), kInvalidInput (the session is open).
  Status put(const Uuid& session, std::span<const pb::SyringeEvent> events);
  /// Ordered by time; nothing if put() was never called. kNotFound: unknown session.
  Result<std::optional<std::vector<pb::SyringeEvent>>> list(const Uuid& session);

 private:
  Connection& connection_;
};

/// An instructor's remark on a tick of a session.
struct StoredAnnotation {
  std::uint64_t id = 0;
  Uuid session{};
  std::uint64_t tick = 0;
  std::string text;
  std::string author;
  std::int64_t created_unix_ns = 0;
};

/// A remark's position within its session. Both fields are at most 2^63 - 1.
struct AnnotationPlace {
  std::uint64_t tick = 0, id = 0;
};

/// Does not own the connection. Thread: as its Connection; changes need the writer's.
class AnnotationStore {
 public:
  explicit AnnotationStore(Connection& connection) : connection_(connection) {}

  /// Returns the new id; ignores `annotation.id`. Errors: kInvalidInput (text), kNotFound (session).
  Result<std::uint64_t> add(const StoredAnnotation& annotation);
  /// Sorted by tick and id; all, or those after `after`. `take` returns false to stop: that remark is
  /// dropped, and hardly any more are read. kNotFound: unknown session.
  Result<std::vector<StoredAnnotation>> list(const Uuid& session,
                                             const std::optional<AnnotationPlace>& after = {},
                                             const std::function<bool(const StoredAnnotation&)>& take = {});
  /// The text of a session's remark; nothing if it has no remark with this id.
  Result<std::optional<std::string>> textOf(const Uuid& session, std::uint64_t id);
  /// The session's first remark with this author and text, if any.
  Result<std::optional<std::uint64_t>> find(const Uuid& session, std::string_view author,
                                            std::string_view text);

 private:
  Connection& connection_;
};

}  // namespace needlelab
