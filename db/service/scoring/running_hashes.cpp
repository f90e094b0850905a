#include "db/service/scoring/running_hashes.h"

#include <algorithm>

namespace needlelab {

HashSoFar RunningHashes::take(const Uuid& session) {
  const std::scoped_lock lock(mutex_);
  const auto found = kept_.find(session);
  if (found == kept_.end()) return {};
  const HashSoFar so_far = found->second.so_far;
  kept_.erase(found);
  return so_far;
}

void RunningHashes::keep(const Uuid& session, const HashSoFar& so_far, std::uint64_t read_bytes) {
  const std::scoped_lock lock(mutex_);
  bytes_hashed_ += read_bytes;
  if (kept_.size() >= kMaxSessions && !kept_.contains(session)) {
    const auto earlier = [](const auto& a, const auto& b) { return a.second.used < b.second.used; };
    kept_.erase(std::min_element(kept_.begin(), kept_.end(), earlier));
  }
  kept_[session] = {so_far, ++turn_};
}

Result<std::optional<HashedChunks>> RunningHashes::goOn(SessionStore& sessions, const Uuid& session,
                                                        std::uint64_t chunks) {
  HashSoFar so_far = take(session);
  if (so_far.chunks > chunks) so_far = {};
  const std::uint64_t before = so_far.bytes;
  const Status read = sessions.hashOn(session, chunks, kMaxBytesAtOnce, so_far);
  // also after an error: chunks before a damaged one need not be read again
  keep(session, so_far, so_far.bytes - before);
  if (!read) return read.error();
  if (so_far.chunks < chunks) return std::optional<HashedChunks>();
  return std::optional(so_far.result());
}

void RunningHashes::forget(const Uuid& session) {
  const std::scoped_lock lock(mutex_);
  kept_.erase(session);
}

std::uint64_t RunningHashes::bytesHashed() const {
  const std::scoped_lock lock(mutex_);
  return bytes_hashed_;
}

std::size_t RunningHashes::sessions() const {
  const std::scoped_lock lock(mutex_);
  return kept_.size();
}

}  // namespace needlelab
