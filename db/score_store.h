/// Scores of sessions, each under the version of the definitions that it was made with, and the sessions of
/// experts that an exercise's bands are made of.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/base/uuid.h"
#include "db/connection.h"
#include "needlelab/teaching.pb.h"

namespace needlelab {

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

class ReferenceStore {
 public:
  explicit ReferenceStore(Connection& connection) : connection_(connection) {}

  /// The next revision, without bands. `base`: the revision that the choice was made from, else kConflict.
  /// kNotFound: exercise or a session is not there; kInvalidInput: a session of another exercise, twice the
  /// same, not closed, too many.
  Result<pb::Reference> put(const std::string& exercise_id, const std::vector<Uuid>& sessions,
                            std::uint32_t base, const std::string& by, std::int64_t now_unix_ns);
  /// The newest; revision 0 and no sessions when none was chosen.
  Result<pb::Reference> get(std::string_view exercise_id);

 private:
  Connection& connection_;
};

}  // namespace needlelab
