/// The cut memory (CUT_MEMORY) as bytes, in live frames and in chunks, for readers that did not follow the
/// session from its beginning (common/gesture/FORMAT.md, "Memory of the cut").
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "common/haptics/sim_state.h"

namespace needlelab {

/// The memory after a tick with the tip outside; it does not describe an insertion under way.
struct CutSnapshot {
  std::uint64_t tick = 0;  ///< of the session
  CutMemory cuts;
  std::uint64_t insertions = 0;  ///< as in SimState: STATISTICAL's random numbers depend on it
};

/// The maximum length of the bytes.
inline constexpr std::size_t kMaxCutSnapshotBytes = 20 + (61 + 9 * kMaxCutHoles) * kMaxCutTracks;

/// Thread: any. Not for the haptic thread: it allocates.
Bytes encodeCuts(const CutSnapshot& snapshot);

/// Safe for any bytes. Errors: kVersion, kCorrupt (wrong length, invalid ring, a number that is not finite, a
/// direction that is not a unit vector, a negative length).
Result<CutSnapshot> decodeCuts(ByteView bytes);
/// As decodeCuts, but returns nothing for empty or unreadable bytes; a replica without them stays
/// approximate.
std::optional<CutSnapshot> cutsIn(ByteView bytes);

}  // namespace needlelab
