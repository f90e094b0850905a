/// The memory of the cut (CUT_MEMORY) as bytes, for a viewer that did not see the session from its beginning
/// (proto/README.md, "Live plane").
#pragma once

#include <cstddef>
#include <cstdint>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "common/haptics/sim_state.h"

namespace needlelab {

/// The memory as it is after a tick with the tip outside; of an insertion under way it says nothing.
struct CutSnapshot {
  std::uint64_t tick = 0;  ///< of the session
  CutMemory cuts;
};

/// The greatest length of the bytes.
inline constexpr std::size_t kMostCutSnapshotBytes = 12 + 60 * kMaxCutTracks;

/// Thread: any. Not for the haptic thread: it allocates.
Bytes encodeCuts(const CutSnapshot& snapshot);

/// Safe for any bytes. Errors: kVersion, kCorrupt (another length, no ring, a number that is not finite, a
/// direction that is none, a negative length).
Result<CutSnapshot> decodeCuts(ByteView bytes);

}  // namespace needlelab
