/// The path of a needle in a body as bytes, in live frames and in chunks (common/gesture/FORMAT.md, "Paths in
/// a body").
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "common/haptics/body/path_stack.h"

namespace needlelab {

/// The maximum length of an encoded path.
inline constexpr std::size_t kMaxPathBytes = 98 + 9 * kMaxStackLayers;

/// A path and the tick of the sample that the station stepped with it: a reader takes the path before that
/// sample (common/gesture/FORMAT.md, "Paths in a body").
struct PathSnapshot {
  std::uint64_t tick = 0;  ///< of the session
  PathLayers path;
};
Bytes encodePath(const PathSnapshot& snapshot);
/// Safe for any bytes. Errors: kVersion, kCorrupt (wrong length, a number that is not finite, a direction
/// that is not a unit vector, tops that do not ascend from 0).
Result<PathSnapshot> decodePath(ByteView bytes);

/// The maximum length of a list of paths, as in a chunk and in a live frame: room for 80 of the longest.
/// There is one for each entry, and at most one in 5 ms while the needle's line turns.
inline constexpr std::size_t kMaxPathListBytes = 32'768;
static_assert(80 * (2 + kMaxPathBytes) <= kMaxPathListBytes);
/// Appends a path to a list, each after its length. False if the list is full: it is then as before.
bool appendPath(const PathSnapshot& snapshot, Bytes& list);
/// The paths of a list in its order, without those that decodePath refuses. Safe for any bytes; a list that
/// is too long has none, one that is cut off has those before.
std::vector<PathSnapshot> pathsIn(ByteView list);

}  // namespace needlelab
