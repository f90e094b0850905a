/// A cache of the tip's paths in reference sessions, for comparison with gestures. Private to this folder.
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

/// Maximum number of reference sessions in a comparison: the first ones of the list.
inline constexpr int kMostReferencePaths = 20;

/// A stored recording never changes, so a cached path stays valid. Thread: every function is thread-safe;
/// other calls continue while one reads a path that is not cached.
class ReferencePaths {
 public:
  /// The path of one session. Empty: never in tissue, or its original is gone, damaged or too long to be
  /// scored.
  TipPath of(Connection& reader, const Uuid& session);
  /// The paths of an exercise's reference sessions, without `except` and without empty ones. Errors: the
  /// database's.
  Result<std::vector<TipPath>> ofExercise(Connection& reader, const std::string& exercise_id,
                                          std::optional<Uuid> except);
  std::vector<TipPath> ofReference(Connection& reader, const pb::Reference& reference,
                                   std::optional<Uuid> except);

  /// Clears the cache after an erasure of a person's data.
  void forget();

 private:
  std::mutex mutex_;
  std::map<Uuid, TipPath> known_;
};

}  // namespace needlelab
