/// The tip's paths in reference sessions and the distances between them, for comparison with gestures.
/// Private to db/service.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "common/base/result.h"
#include "common/base/text/uuid.h"
#include "common/scoring/motion/dtw.h"
#include "db/store/connection.h"
#include "needlelab/teaching.pb.h"

namespace needlelab {

/// Maximum number of reference sessions in a comparison; the first ones of the list are used.
inline constexpr int kMaxReferencePaths = 20;
/// A comparison starts no more work beyond this, in cells of dtwCells(): about 1 s. 20 gestures of a minute
/// at 1 kHz take 170 million.
inline constexpr std::uint64_t kMaxComparedCells = 200'000'000;
/// Same for one step of a close, for which others wait: about 0.2 s.
inline constexpr std::uint64_t kMaxClosingCells = 40'000'000;
/// Cost of one sample read for a path; counted before reading.
inline constexpr std::uint64_t kCellsOfSample = 50;

/// Caches paths and distances by session. A stored recording does not change, so they are valid for every
/// revision of a reference and every version of the scores, until the recording is removed (forget) or there
/// are too many. Also cached: that a closed session has no path, because it was never in tissue or its
/// original is gone, damaged or too long to be scored. One call reads and computes a bounded part of what is
/// missing, but at least one path or distance, and the next call continues, so long references become known
/// after some calls. Thread: every function is thread-safe; while one call reads a path or computes a
/// distance, only calls that need the same one wait.
class ReferencePaths {
 public:
  struct NearestPath {
    std::optional<TipPath> path;  ///< nothing: no path, no other session has one, or pending
    bool is_pending = false;      ///< not all distances are computed yet
  };
  /// Progress of nearestPath() for a session over its calls, unaffected by forget() in between. Up to 430
  /// KiB.
  struct UnderWay {
    std::optional<std::vector<Uuid>> references;  ///< as of the first call
    std::size_t compared = 0;                     ///< of these
    std::optional<Uuid> nearest;                  ///< of the compared ones; nothing: none has a path
    double nearest_m = 0;
    std::map<Uuid, TipPath> paths;  ///< its own, the nearest one, and the next one to compare
  };
  /// The path of the exercise's reference session (other than `session`) that is nearest to a closed session.
  /// One call costs at most kMaxClosingCells; each completes at least one path or distance, so at most 2
  /// (kMaxReferencePaths + 1) calls are needed, even if the references change meanwhile. Errors: the
  /// database's.
  Result<NearestPath> nearestPath(Connection& reader, const std::string& exercise_id, const Uuid& session,
                                  UnderWay& under_way);
  /// For each reference session, the distance to the nearest other one, in m, without those that have no
  /// path, like distancesAmong() (common/scoring/attempts/reference.h). Nothing: not all are computed yet.
  std::optional<std::vector<double>> distancesAmongSessions(Connection& reader,
                                                            const pb::Reference& reference);
  struct Nearest {
    std::optional<double> distance_m;  ///< nothing: no path, no other session has one, or pending
    bool is_pending = false;           ///< not all distances are computed yet
  };
  /// The distance to the nearest reference session other than itself.
  Nearest nearestDistance(Connection& reader, const Uuid& session, const pb::Reference& reference);

  /// Replaces kMaxComparedCells, and kMaxClosingCells if that is greater. Call before the first comparison.
  void setMostCells(std::uint64_t cells) { max_cells_ = cells; }

  /// Forgets everything, because recordings were removed by an erasure or by retention. Results of reads and
  /// computations in progress are not kept either.
  void forget();
  /// Distances computed since the start; measures the cost of comparisons.
  [[nodiscard]] std::uint64_t distancesComputed() const;

 private:
  class Lookup;
  struct NearestSession;
  template <typename Key>
  class Turn;
  static NearestSession nearestSession(Lookup& lookup, const Uuid& session, const pb::Reference& reference);
  using Pair = std::pair<Uuid, Uuid>;  // the smaller id first

  std::uint64_t max_cells_ = kMaxComparedCells;
  mutable std::mutex mutex_;  // guards everything below
  std::condition_variable ended_;
  std::set<Uuid> reading_;  // paths and distances that a call is working on
  std::set<Pair> computing_;
  std::map<Uuid, TipPath> paths_;
  std::map<Pair, std::optional<double>> distances_;
  std::uint64_t forgotten_ = 0;  // count of forget() calls
  std::uint64_t computed_ = 0;
};

}  // namespace needlelab
