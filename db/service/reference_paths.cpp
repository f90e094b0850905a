#include "db/service/reference_paths.h"

#include <algorithm>
#include <cstddef>

#include "common/scoring/reference.h"
#include "db/service/handlers.h"
#include "db/service/session_samples.h"
#include "db/session_results.h"

namespace needlelab {
namespace {

/// At most 144 KiB each; when there are more, all paths are dropped and read again on demand.
constexpr std::size_t kMostKnownPaths = 200;
/// Some 100 bytes each. When there are more, all are dropped and computed again on demand.
constexpr std::size_t kMostKnownDistances = 20'000;

std::vector<Uuid> sessionsOf(const pb::Reference& reference, std::optional<Uuid> except) {
  std::vector<Uuid> sessions;
  const int count = std::min(reference.session_ids_size(), kMostReferencePaths);
  for (int i = 0; i < count; ++i) {
    const auto id = handlers::sessionId(reference.session_ids(i));
    if (id && (!except || *id != *except)) sessions.push_back(*id);
  }
  return sessions;
}

}  // namespace

/// The call that reads a path or computes a distance; at its end, whatever the end, others go on. Without the
/// lock.
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

/// One call's use of what is known. It reads each path at most once, even one that cannot be read now, and
/// only where a distance is not known.
class ReferencePaths::Lookup {
 public:
  Lookup(ReferencePaths& known, Connection& reader) : known_(known), reader_(reader) {
    const std::scoped_lock lock(known_.mutex_);
    forgotten_ = known_.forgotten_;
  }

  /// Nothing: it cannot be read now. Valid while this lives.
  const std::optional<TipPath>& path(const Uuid& session) {
    const auto [entry, is_new] = paths_.try_emplace(session);
    if (!is_new) return entry->second;
    std::unique_lock lock(known_.mutex_);
    known_.ended_.wait(lock, [&] { return !known_.reading_.contains(session); });
    if (const auto found = known_.paths_.find(session); found != known_.paths_.end()) {
      entry->second = found->second;
      return entry->second;
    }
    known_.reading_.insert(session);
    lock.unlock();
    const Turn turn(known_, known_.reading_, session);
    entry->second = readPath(session);
    if (!entry->second) return entry->second;
    const std::scoped_lock keep(known_.mutex_);
    if (known_.forgotten_ != forgotten_) return entry->second;
    if (known_.paths_.size() >= kMostKnownPaths) known_.paths_.clear();
    known_.paths_.emplace(session, *entry->second);
    return entry->second;
  }

  /// Nothing: one of both has no path, or it is pending.
  std::optional<double> distance(const Uuid& a, const Uuid& b) {
    const Pair pair(std::min(a, b), std::max(a, b));
    std::unique_lock lock(known_.mutex_);
    known_.ended_.wait(lock, [&] { return !known_.computing_.contains(pair); });
    if (const auto found = known_.distances_.find(pair); found != known_.distances_.end())
      return found->second;
    if (spent_cells_ >= known_.most_cells_) {
      is_pending_ = true;
      return std::nullopt;
    }
    known_.computing_.insert(pair);
    lock.unlock();
    const Turn turn(known_, known_.computing_, pair);
    const auto& one = path(pair.first);
    const auto& other = path(pair.second);
    if (!one || !other) return std::nullopt;
    spent_cells_ += dtwCells(one->size(), other->size());
    const auto distance = dtwDistance(*one, *other);
    const std::scoped_lock keep(known_.mutex_);
    ++known_.computed_;
    if (known_.forgotten_ != forgotten_) return distance;
    if (known_.distances_.size() >= kMostKnownDistances) known_.distances_.clear();
    known_.distances_.emplace(pair, distance);
    return distance;
  }

  /// Whether a distance was left to the next call.
  [[nodiscard]] bool isPending() const { return is_pending_; }

 private:
  std::optional<TipPath> readPath(const Uuid& session) {
    const auto read = samplesOf(reader_, session);
    // what will never be scored, or is damaged, has no path; any other failure may pass
    if (!read) return isLasting(read.error()) ? std::optional(TipPath()) : std::nullopt;
    TipPath path = tipPathOf(read->samples, read->info.description().rate_hz(), read->X_WL);
    if (!read->samples.fault().ok()) return std::nullopt;
    spent_cells_ += kCellsOfSample * read->info.samples();
    return path;
  }

  ReferencePaths& known_;
  Connection& reader_;
  std::uint64_t spent_cells_ = 0;
  bool is_pending_ = false;
  std::uint64_t forgotten_ = 0;
  std::map<Uuid, std::optional<TipPath>> paths_;
};

Result<std::vector<TipPath>> ReferencePaths::ofExercise(Connection& reader, const std::string& exercise_id,
                                                        std::optional<Uuid> except) {
  ASSIGN_OR_RETURN(const auto reference, ReferenceStore(reader).get(exercise_id));
  Lookup lookup(*this, reader);
  std::vector<TipPath> paths;
  for (const Uuid& session : sessionsOf(reference, except)) {
    if (const auto& path = lookup.path(session); path && !path->empty()) paths.push_back(*path);
  }
  return paths;
}

std::optional<std::vector<double>> ReferencePaths::distancesAmongSessions(Connection& reader,
                                                                          const pb::Reference& reference) {
  const auto sessions = sessionsOf(reference, std::nullopt);
  Lookup lookup(*this, reader);
  auto distances = distancesAmong(sessions.size(), [&](std::size_t i, std::size_t j) {
    return lookup.distance(sessions[i], sessions[j]);
  });
  if (lookup.isPending()) return std::nullopt;
  return distances;
}

ReferencePaths::Nearest ReferencePaths::nearestDistance(Connection& reader, const Uuid& session,
                                                        const pb::Reference& reference) {
  Lookup lookup(*this, reader);
  Nearest nearest;
  for (const Uuid& other : sessionsOf(reference, session)) {
    const auto distance = lookup.distance(session, other);
    if (distance && (!nearest.distance_m || *distance < *nearest.distance_m)) nearest.distance_m = distance;
  }
  nearest.is_pending = lookup.isPending();
  if (nearest.is_pending) nearest.distance_m.reset();
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
