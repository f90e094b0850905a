#include "db/service/reference_paths.h"

#include <algorithm>

#include "common/scoring/dtw.h"
#include "db/service/handlers.h"
#include "db/service/session_samples.h"
#include "db/session_results.h"

namespace needlelab {
namespace {

/// At most 144 KiB each; with more of them all are forgotten, and read anew as they are asked for.
constexpr std::size_t kMostKnownPaths = 200;

}  // namespace

TipPath ReferencePaths::of(Connection& reader, const Uuid& session) {
  {
    const std::scoped_lock lock(mutex_);
    if (const auto found = known_.find(session); found != known_.end()) return found->second;
  }
  const auto read = samplesOf(reader, session);
  // what may be read better another time is not kept
  if (!read) return {};
  TipPath path = tipPathOf(read->samples, read->info.description().rate_hz(), read->X_WL);
  const std::scoped_lock lock(mutex_);
  if (known_.size() >= kMostKnownPaths) known_.clear();
  known_.emplace(session, path);
  return path;
}

std::vector<TipPath> ReferencePaths::ofReference(Connection& reader, const pb::Reference& reference,
                                                 std::optional<Uuid> except) {
  std::vector<TipPath> paths;
  const int count = std::min(reference.session_ids_size(), kMostReferencePaths);
  for (int i = 0; i < count; ++i) {
    const auto id = handlers::sessionId(reference.session_ids(i));
    if (!id || (except && *id == *except)) continue;
    TipPath path = of(reader, *id);
    if (!path.empty()) paths.push_back(std::move(path));
  }
  return paths;
}

Result<std::vector<TipPath>> ReferencePaths::ofExercise(Connection& reader, const std::string& exercise_id,
                                                        std::optional<Uuid> except) {
  const auto reference = ReferenceStore(reader).get(exercise_id);
  if (!reference) return reference.error();
  return ofReference(reader, *reference, except);
}

void ReferencePaths::forget() {
  const std::scoped_lock lock(mutex_);
  known_.clear();
}

}  // namespace needlelab
