/// The tip's paths of reference sessions, read once and kept: what gestures are compared with. Private to
/// this folder.
#pragma once

#include <map>
#include <mutex>
#include <optional>
#include <vector>

#include "common/base/result.h"
#include "common/base/uuid.h"
#include "common/scoring/dtw.h"
#include "db/connection.h"
#include "needlelab/teaching.pb.h"

namespace needlelab {

/// A gesture is compared with so many reference sessions at most, the first ones of the list.
inline constexpr int kMostReferencePaths = 20;

/// A stored recording never changes, so that a path that was read stays true. Thread: every function is
/// thread-safe; a path that is not known yet is read while others go on.
class ReferencePaths {
 public:
  /// Of one session. Empty: never in tissue, or its original is gone, damaged or too long to be scored.
  TipPath of(Connection& reader, const Uuid& session);
  /// Of an exercise's reference sessions, without `except` and without empty ones. Errors: the database's.
  Result<std::vector<TipPath>> ofExercise(Connection& reader, const std::string& exercise_id,
                                          std::optional<Uuid> except);
  std::vector<TipPath> ofReference(Connection& reader, const pb::Reference& reference,
                                   std::optional<Uuid> except);

  /// All of them: somebody's data was erased.
  void forget();

 private:
  std::mutex mutex_;
  std::map<Uuid, TipPath> known_;
};

}  // namespace needlelab
