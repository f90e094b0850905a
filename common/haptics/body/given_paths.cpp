#include "common/haptics/body/given_paths.h"

namespace needlelab {
namespace {

/// More than a list has.
constexpr std::size_t kMaxWaiting = 1024;

}  // namespace

void GivenPaths::take(const PathSnapshot& snapshot) {
  if (!waiting_.empty() && snapshot.tick <= waiting_.back().tick) waiting_.clear();
  waiting_.push_back(snapshot);
  if (waiting_.size() > kMaxWaiting) waiting_.pop_front();
}

void GivenPaths::take(ByteView list) {
  for (const PathSnapshot& snapshot : pathsIn(list)) take(snapshot);
}

void GivenPaths::giveFor(std::uint64_t tick, const StoredTick& stored, SceneEngine& engine) {
  while (!waiting_.empty() && waiting_.front().tick < tick) waiting_.pop_front();
  const bool waits = !waiting_.empty() && waiting_.front().tick == tick;
  const bool enters = (stored.flags & kFlagEntry) != 0;
  const bool begins = stored.layer >= 0 && (stored.flags & kFlagNewPath) != 0;
  const bool given =
      waits && (enters || begins || !engine.state().inside) && engine.givePath(waiting_.front().path, enters);
  if (enters)
    unknown_ = !given;
  else if (begins && !given)
    unknown_ = true;
  if (waits) waiting_.pop_front();
}

}  // namespace needlelab
