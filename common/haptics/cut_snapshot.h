/// The memory of the cut (CUT_MEMORY) as bytes, for who did not see the session from its beginning: in live
/// frames and in chunks (common/gesture/FORMAT.md, "Memory of the cut").
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "common/haptics/sim_state.h"

namespace needlelab {

/// The memory as it is after a tick with the tip outside; of an insertion under way it says nothing.
struct CutSnapshot {
  std::uint64_t tick = 0;  ///< of the session
  CutMemory cuts;
  std::uint64_t insertions = 0;  ///< as in SimState: STATISTICAL draws by it
};

/// The greatest length of the bytes.
inline constexpr std::size_t kMostCutSnapshotBytes = 20 + 60 * kMaxCutTracks;

/// Thread: any. Not for the haptic thread: it allocates.
Bytes encodeCuts(const CutSnapshot& snapshot);

/// Safe for any bytes. Errors: kVersion, kCorrupt (another length, no ring, a number that is not finite, a
/// direction that is none, a negative length).
Result<CutSnapshot> decodeCuts(ByteView bytes);
/// Returns what decodeCuts reads; nothing of none and of unreadable bytes, without which a replica stays
/// approximate.
std::optional<CutSnapshot> cutsIn(ByteView bytes);

}  // namespace needlelab
