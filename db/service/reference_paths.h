/// The tip's paths in reference sessions and the distances between them, for comparison with gestures.
/// Private to this folder.
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
#include "common/base/uuid.h"
#include "common/scoring/dtw.h"
#include "db/connection.h"
#include "needlelab/teaching.pb.h"

namespace needlelab {

/// Maximum number of reference sessions in a comparison: the first ones of the list.
inline constexpr int kMostReferencePaths = 20;
/// The work that a comparison begins nothing beyond, in cells of dtwCells(): some 1 s. 20 gestures of a
/// minute at 1 kHz take 170 million.
inline constexpr std::uint64_t kMostComparedCells = 200'000'000;
/// The same for one step of a close, for which others wait: some 0.2 s.
inline constexpr std::uint64_t kMostClosingCells = 40'000'000;
/// What a sample of a recording costs that is read for its path, counted before it is read.
inline constexpr std::uint64_t kCellsOfSample = 50;

/// Keeps the paths that it reads and the distances that it computes, by session: a stored recording does not
/// change, so they hold for every revision of a reference and for every version of the scores, until the
/// recording goes (forget), or there are too many. So does that a closed session has no path, whatever the
/// reason: never in tissue, or its original is gone, damaged or too long to be scored. One call reads and
/// computes a bounded part of what is not known, but at least one path or one distance, and the next one goes
/// on: long references are known after some calls. Thread: every function is thread-safe; other calls
/// continue while one reads a path or computes a distance, but for those that want the same: they wait for
/// it.
class ReferencePaths {
 public:
  struct NearestPath {
    std::optional<TipPath> path;  ///< nothing: it has no path, no other one has, or it is pending
    bool is_pending = false;      ///< not all distances are computed yet
  };
  /// What nearestPath() has found for a session in its calls so far, whatever others make this forget between
  /// them. Up to 430 KiB.
  struct UnderWay {
    std::optional<std::vector<Uuid>> references;  ///< as they were at the first call
    std::size_t compared = 0;                     ///< of these
    std::optional<Uuid> nearest;                  ///< of the compared ones; nothing: none has a path
    double nearest_m = 0;
    std::map<Uuid, TipPath> paths;  ///< its own, the nearest one, and the one that is compared next
  };
  /// The path of the exercise's reference session, without itself, that is nearest to a closed session. One
  /// call costs kMostClosingCells at most; each ends at least one path or one distance, so at most
  /// 2 (kMostReferencePaths + 1) are needed, whatever the references are meanwhile. Errors: the database's.
  Result<NearestPath> nearestPath(Connection& reader, const std::string& exercise_id, const Uuid& session,
                                  UnderWay& under_way);
  /// The distance of each reference session from the nearest other one, in m; without those that have no
  /// path, as distancesAmong() their paths (scoring/reference.h). Nothing: not all are computed yet.
  std::optional<std::vector<double>> distancesAmongSessions(Connection& reader,
                                                            const pb::Reference& reference);
  struct Nearest {
    std::optional<double> distance_m;  ///< nothing: it has no path, no other one has, or it is pending
    bool is_pending = false;           ///< not all distances are computed yet
  };
  /// The distance of a session from the nearest reference session that is not itself.
  Nearest nearestDistance(Connection& reader, const Uuid& session, const pb::Reference& reference);

  /// Another bound than kMostComparedCells, and than kMostClosingCells if it is less. Call before the first
  /// comparison.
  void setMostCells(std::uint64_t cells) { most_cells_ = cells; }

  /// Forgets everything: recordings were removed, by an erasure or by retention. What others are reading or
  /// computing meanwhile is not kept either.
  void forget();
  /// Distances computed since the start: what comparisons cost.
  [[nodiscard]] std::uint64_t distancesComputed() const;

 private:
  class Lookup;
  struct NearestSession;
  template <typename Key>
  class Turn;
  static NearestSession nearestSession(Lookup& lookup, const Uuid& session, const pb::Reference& reference);
  using Pair = std::pair<Uuid, Uuid>;  // the smaller id first

  std::uint64_t most_cells_ = kMostComparedCells;
  mutable std::mutex mutex_;  // guards all below
  std::condition_variable ended_;
  std::set<Uuid> reading_;  // paths and distances that a call is at
  std::set<Pair> computing_;
  std::map<Uuid, TipPath> paths_;
  std::map<Pair, std::optional<double>> distances_;
  std::uint64_t forgotten_ = 0;  // times
  std::uint64_t computed_ = 0;
};

}  // namespace needlelab
