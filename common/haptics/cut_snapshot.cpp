#include "common/haptics/cut_snapshot.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include <fmt/core.h>

#include "common/haptics/vector_bytes.h"

namespace needlelab {
namespace {

// version 1 lacked the number of insertions and was never stored; a memory with holes of a body is of the
// last
constexpr std::uint8_t kCutVersion = 2, kCutVersionWithHoles = 3;

Error corruptCuts(const std::string& what) {
  return {ErrorCode::kCorrupt, "memory of the cut: " + what};
}

bool isTrack(const CutTrack& track) {
  return isFinite(track.p_entry_W_m) && isDirection(track.u_W) && std::isfinite(track.length_m) &&
         track.length_m >= 0 && track.hole_count <= kMaxCutHoles &&
         std::all_of(track.holes.begin(), track.holes.begin() + track.hole_count,
                     [](const CutHole& hole) { return hole.id < kMaxLayers && std::isfinite(hole.at_m); });
}

// a ring that is not full is filled from its start
bool isRing(const CutMemory& cuts) {
  if (cuts.count > kMaxCutTracks || cuts.next >= kMaxCutTracks) return false;
  return cuts.count == kMaxCutTracks || cuts.next == cuts.count;
}

}  // namespace

Bytes encodeCuts(const CutSnapshot& snapshot) {
  const CutMemory& cuts = snapshot.cuts;
  assert(isRing(cuts));
  Bytes bytes;
  bytes.reserve(kMaxCutSnapshotBytes);
  ByteWriter to(bytes);
  const bool has_holes = std::any_of(cuts.tracks.begin(), cuts.tracks.begin() + cuts.count,
                                     [](const CutTrack& track) { return track.hole_count > 0; });
  to.put(has_holes ? kCutVersionWithHoles : kCutVersion);
  to.put(static_cast<std::uint8_t>(cuts.count));
  to.put(static_cast<std::uint8_t>(cuts.next));
  to.put(std::uint8_t{0});
  to.put(snapshot.tick);
  to.put(snapshot.insertions);
  for (std::uint32_t i = 0; i < cuts.count; ++i) {
    const CutTrack& track = cuts.tracks[i];
    putVector(to, track.p_entry_W_m);
    putVector(to, track.u_W);
    to.put(track.length_m);
    to.put(track.membranes);
    if (!has_holes) continue;
    to.put(static_cast<std::uint8_t>(track.hole_count));
    for (std::uint32_t k = 0; k < track.hole_count; ++k) {
      to.put(track.holes[k].id);
      to.put(track.holes[k].at_m);
    }
  }
  assert(bytes.size() <= kMaxCutSnapshotBytes);
  return bytes;
}

Result<CutSnapshot> decodeCuts(ByteView bytes) {
  ByteReader from(bytes);
  const auto version = from.get<std::uint8_t>();
  if (from.ok() && version != kCutVersion && version != kCutVersionWithHoles)
    return Error{ErrorCode::kVersion,
                 fmt::format("memory of the cut: version {}, this program reads {} and {}", version,
                             kCutVersion, kCutVersionWithHoles)};
  CutSnapshot snapshot;
  CutMemory& cuts = snapshot.cuts;
  cuts.count = from.get<std::uint8_t>();
  cuts.next = from.get<std::uint8_t>();
  const auto filler = from.get<std::uint8_t>();
  snapshot.tick = from.get<std::uint64_t>();
  snapshot.insertions = from.get<std::uint64_t>();
  if (!from.ok()) return corruptCuts(fmt::format("{} bytes are too few", bytes.size()));
  if (filler != 0) return corruptCuts(fmt::format("byte 3 is {}, it must be 0", filler));
  if (!isRing(cuts))
    return corruptCuts(fmt::format("{} tracks with the next at {} are not a valid ring of {}", cuts.count,
                                   cuts.next, kMaxCutTracks));
  for (std::uint32_t i = 0; i < cuts.count; ++i) {
    CutTrack& track = cuts.tracks[i];
    track.p_entry_W_m = vectorFrom(from);
    track.u_W = vectorFrom(from);
    track.length_m = from.get<double>();
    track.membranes = from.get<std::uint32_t>();
    track.hole_count = version == kCutVersionWithHoles ? from.get<std::uint8_t>() : 0;
    for (std::uint32_t k = 0; k < std::min<std::size_t>(track.hole_count, kMaxCutHoles); ++k) {
      track.holes[k].id = from.get<std::uint8_t>();
      track.holes[k].at_m = from.get<double>();
    }
    if (!from.ok()) return corruptCuts(fmt::format("{} bytes are too few", bytes.size()));
    if (!isTrack(track)) return corruptCuts(fmt::format("track {} is not a line with a length and holes", i));
  }
  if (from.left() != 0) return corruptCuts(fmt::format("{} bytes are left over", from.left()));
  return snapshot;
}

std::optional<CutSnapshot> cutsIn(ByteView bytes) {
  if (bytes.empty()) return std::nullopt;
  const auto cuts = decodeCuts(bytes);
  return cuts.ok() ? std::optional(*cuts) : std::nullopt;
}

}  // namespace needlelab
