/// The tip's paths in reference sessions and the distances between them, for comparison with gestures.
/// Private to this folder.
#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/base/result.h"
#include "common/base/uuid.h"
#include "common/scoring/dtw.h"
#include "db/connection.h"
#include "needlelab/teaching.pb.h"

namespace needlelab {

/// Maximum number of reference sessions in a comparison: the first ones of the list.
inline constexpr int kMostReferencePaths = 20;

/// Keeps the paths that it reads and the distances that it computes, by session: a stored recording does not
/// change, so they hold for every revision of a reference and for every version of the scores, until the
/// recording goes (forget). Thread: every function is thread-safe; other calls continue while one reads a
/// path or computes a distance.
class ReferencePaths {
 public:
  /// The paths of an exercise's reference sessions, without `except` and without empty ones (never in tissue,
  /// or its original is gone, damaged or too long to be scored). Errors: the database's.
  Result<std::vector<TipPath>> ofExercise(Connection& reader, const std::string& exercise_id,
                                          std::optional<Uuid> except);
  /// The distance of each reference session from the nearest other one, in m; without those that have no
  /// path, as distancesAmong() their paths (scoring/reference.h).
  std::vector<double> distancesAmongSessions(Connection& reader, const pb::Reference& reference);
  /// The distance of a session from the nearest reference session that is not itself, in m. Nothing: it has
  /// no path, or no other one has.
  std::optional<double> nearestDistance(Connection& reader, const Uuid& session,
                                        const pb::Reference& reference);

  /// Forgets everything: recordings were removed, by an erasure or by retention. What others are reading or
  /// computing meanwhile is not kept either.
  void forget();
  /// Distances computed since the start: what comparisons cost.
  [[nodiscard]] std::uint64_t distancesComputed() const;

 private:
  class Lookup;
  using Pair = std::pair<Uuid, Uuid>;  // the smaller id first

  mutable std::mutex mutex_;
  std::map<Uuid, TipPath> paths_;
  std::map<Pair, std::optional<double>> distances_;
  std::uint64_t forgotten_ = 0;  // times
  std::uint64_t computed_ = 0;
};

}  // namespace needlelab
