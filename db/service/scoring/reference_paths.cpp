#include "db/service/scoring/reference_paths.h"

#include <algorithm>
#include <cstddef>

#include "common/scoring/attempts/reference.h"
#include "db/service/context/context.h"
#include "db/service/scoring/session_samples.h"
#include "db/sessions/session_results.h"
#include "db/sessions/session_store.h"

namespace needlelab {
namespace {

/// At most 144 KiB each; if there are more, all paths are dropped and read again on demand.
constexpr std::size_t kMaxKnownPaths = 200;
/// About 100 bytes each. If there are more, all are dropped and computed again on demand.
constexpr std::size_t kMaxKnownDistances = 20'000;

std::vector<Uuid> sessionsOf(const pb::Reference& reference, std::optional<Uuid> except) {
  std::vector<Uuid> sessions;
  const int count = std::min(reference.session_ids_size(), kMaxReferencePaths);
  for (int i = 0; i < count; ++i) {
    const auto id = handlers::sessionId(reference.session_ids(i));
    if (id && (!except || *id != *except)) sessions.push_back(*id);
  }
  return sessions;
}

}  // namespace

/// Held by the call that reads a path or computes a distance. Its destructor lets waiting calls continue.
/// Call without holding the lock.
template <typename Key>
class ReferencePaths::Turn {
 public:
  Turn(ReferencePaths& known, std::set<Key>& taken, const Key& key)
      : known_(known), taken_(taken), key_(key) {}
  ~Turn() {
    {
      const std::scoped_lock lock(known_.mutex_);
      taken_.erase(key_);
    }
    known_.ended_.notify_all();
  }
  Turn(const Turn&) = delete;
  Turn& operator=(const Turn&) = delete;

 private:
  ReferencePaths& known_;
  std::set<Key>& taken_;
  const Key key_;
};

/// One call's access to the cache. Reads each path at most once, and only if a distance is unknown.
class ReferencePaths::Lookup {
 public:
  /// `max_cells`: once spent, no more work is started. `paths`: the caller's; paths that it needs are added.
  Lookup(ReferencePaths& known, Connection& reader, std::uint64_t max_cells, std::map<Uuid, TipPath>& paths)
      : known_(known), reader_(reader), max_cells_(max_cells), paths_(paths) {
    const std::scoped_lock lock(known_.mutex_);
    forgotten_ = known_.forgotten_;
  }

  /// Nullptr: pending. Empty: no path. Valid while the caller keeps it.
  const TipPath* path(const Uuid& session) {
    if (const auto own = paths_.find(session); own != paths_.end()) return &own->second;
    std::unique_lock lock(known_.mutex_);
    known_.ended_.wait(lock, [&] { return !known_.reading_.contains(session); });
    if (const auto found = known_.paths_.find(session); found != known_.paths_.end())
      return &paths_.emplace(session, found->second).first->second;
    if (isSpent()) return nullptr;
    known_.reading_.insert(session);
    lock.unlock();
    const Turn turn(known_, known_.reading_, session);
    auto read = readPath(session);
    const TipPath& path = paths_.emplace(session, read ? std::move(*read) : TipPath()).first->second;
    if (!read) return &path;
    const std::scoped_lock keep(known_.mutex_);
    if (known_.forgotten_ != forgotten_) return &path;
    if (known_.paths_.size() >= kMaxKnownPaths) known_.paths_.clear();
    known_.paths_.emplace(session, path);
    return &path;
  }

  /// Nothing: one of them has no path, or it is pending.
  std::optional<double> distance(const Uuid& a, const Uuid& b) {
    const Pair pair(std::min(a, b), std::max(a, b));
    std::unique_lock lock(known_.mutex_);
    known_.ended_.wait(lock, [&] { return !known_.computing_.contains(pair); });
    if (const auto found = known_.distances_.find(pair); found != known_.distances_.end())
      return found->second;
    known_.computing_.insert(pair);
    lock.unlock();
    const Turn turn(known_, known_.computing_, pair);
    const TipPath* const one = path(a);
    if (one == nullptr || one->empty()) return std::nullopt;
    const TipPath* const other = path(b);
    if (other == nullptr || other->empty() || isSpent()) return std::nullopt;
    spent_cells_ += dtwCells(one->size(), other->size());
    const auto distance = dtwDistance(*one, *other);
    const std::scoped_lock keep(known_.mutex_);
    ++known_.computed_;
    if (known_.forgotten_ != forgotten_) return distance;
    if (known_.distances_.size() >= kMaxKnownDistances) known_.distances_.clear();
    known_.distances_.emplace(pair, distance);
    return distance;
  }

  /// Whether a path or a distance was left to the next call.
  [[nodiscard]] bool isPending() const { return is_pending_; }

 private:
  bool isSpent() {
    if (spent_cells_ < max_cells_) return false;
    is_pending_ = true;
    return true;
  }

  /// Nothing: it has no path now, and finding that out cost nothing. A recording is read only once,
  /// regardless of the result.
  std::optional<TipPath> readPath(const Uuid& session) {
    const auto info = SessionStore(reader_).info(session);
    if (!info || info->state() == pb::SESSION_OPEN) return std::nullopt;
    if (info->samples() == 0) return TipPath();
    spent_cells_ += kCellsOfSample * std::min(info->samples(), kMaxScoredSamples);
    const auto read = samplesOf(reader_, session);
    if (!read) return TipPath();
    TipPath path = tipPathOf(read->samples, read->info.description().rate_hz(), read->X_WL);
    return read->samples.fault().ok() ? path : TipPath();
  }

  ReferencePaths& known_;
  Connection& reader_;
  const std::uint64_t max_cells_;
  std::uint64_t spent_cells_ = 0;
  bool is_pending_ = false;
  std::uint64_t forgotten_ = 0;
  std::map<Uuid, TipPath>& paths_;
};

struct ReferencePaths::NearestSession {
  std::optional<Uuid> session;
  double distance_m = 0;
};

/// Nothing while pending: the nearest of some is not the nearest of all.
ReferencePaths::NearestSession ReferencePaths::nearestSession(Lookup& lookup, const Uuid& session,
                                                              const pb::Reference& reference) {
  NearestSession nearest;
  for (const Uuid& other : sessionsOf(reference, session)) {
    const auto distance_m = lookup.distance(session, other);
    if (distance_m && (!nearest.session || *distance_m < nearest.distance_m)) nearest = {other, *distance_m};
  }
  return lookup.isPending() ? NearestSession() : nearest;
}

Result<ReferencePaths::NearestPath> ReferencePaths::nearestPath(Connection& reader,
                                                                const std::string& exercise_id,
                                                                const Uuid& session, UnderWay& under_way) {
  if (!under_way.references) {
    ASSIGN_OR_RETURN(const auto reference, ReferenceStore(reader).get(exercise_id));
    under_way.references = sessionsOf(reference, session);
  }
  const std::vector<Uuid>& references = *under_way.references;
  Lookup lookup(*this, reader, std::min(max_cells_, kMaxClosingCells), under_way.paths);
  for (; under_way.compared < references.size(); ++under_way.compared) {
    const Uuid& other = references[under_way.compared];
    const auto distance_m = lookup.distance(session, other);
    if (lookup.isPending()) return NearestPath{std::nullopt, true};
    const bool is_nearer = distance_m && (!under_way.nearest || *distance_m < under_way.nearest_m);
    // of all paths, only its own and the nearest one are still needed
    if (is_nearer && under_way.nearest) under_way.paths.erase(*under_way.nearest);
    if (!is_nearer) under_way.paths.erase(other);
    if (!is_nearer) continue;
    under_way.nearest = other;
    under_way.nearest_m = *distance_m;
  }
  NearestPath nearest;
  // missing if only the distance was known
  if (under_way.nearest) {
    if (const TipPath* const path = lookup.path(*under_way.nearest); path != nullptr && !path->empty())
      nearest.path = *path;
  }
  nearest.is_pending = lookup.isPending();
  return nearest;
}

std::optional<std::vector<double>> ReferencePaths::distancesAmongSessions(Connection& reader,
                                                                          const pb::Reference& reference) {
  const auto sessions = sessionsOf(reference, std::nullopt);
  std::map<Uuid, TipPath> paths;
  Lookup lookup(*this, reader, max_cells_, paths);
  auto distances = distancesAmong(sessions.size(), [&](std::size_t i, std::size_t j) {
    return lookup.distance(sessions[i], sessions[j]);
  });
  if (lookup.isPending()) return std::nullopt;
  return distances;
}

ReferencePaths::Nearest ReferencePaths::nearestDistance(Connection& reader, const Uuid& session,
                                                        const pb::Reference& reference) {
  std::map<Uuid, TipPath> paths;
  Lookup lookup(*this, reader, max_cells_, paths);
  const auto found = nearestSession(lookup, session, reference);
  Nearest nearest;
  if (found.session) nearest.distance_m = found.distance_m;
  nearest.is_pending = lookup.isPending();
  return nearest;
}

void ReferencePaths::forget() {
  const std::scoped_lock lock(mutex_);
  ++forgotten_;
  paths_.clear();
  distances_.clear();
}

std::uint64_t ReferencePaths::distancesComputed() const {
  const std::scoped_lock lock(mutex_);
  return computed_;
}

}  // namespace needlelab
