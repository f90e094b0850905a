#include "common/haptics/body/path_snapshot.h"

#include <cassert>
#include <cmath>

#include <fmt/core.h>

#include "common/haptics/vector_bytes.h"

namespace needlelab {
namespace {

constexpr std::uint8_t kPathVersion = 1;

Error corruptPath(const std::string& what) {
  return {ErrorCode::kCorrupt, "path in a body: " + what};
}

bool isPlane(Vec3 point_m, Vec3 normal) {
  return isFinite(point_m) && isDirection(normal);
}

}  // namespace

Bytes encodePath(const PathSnapshot& snapshot) {
  const PathLayers& path = snapshot.path;
  assert(path.count <= kMaxStackLayers && path.bones.count <= kMaxBonePlanes);
  Bytes bytes;
  bytes.reserve(kMaxPathBytes);
  ByteWriter to(bytes);
  to.put(kPathVersion);
  to.put(static_cast<std::uint8_t>(path.count));
  to.put(static_cast<std::uint8_t>(path.bones.count));
  to.put(snapshot.tick);
  putVector(to, path.point_W_m);
  putVector(to, path.normal_W);
  to.put(path.changes_from_m);
  for (std::uint32_t i = 0; i < path.count; ++i) {
    to.put(path.layers[i].structure);
    to.put(path.layers[i].top_m);
  }
  for (std::size_t i = 0; i < path.bones.count; ++i) {
    putVector(to, path.bones.planes[i].point_m);
    putVector(to, path.bones.planes[i].normal);
    to.put(path.bones.planes[i].structure);
  }
  assert(bytes.size() <= kMaxPathBytes);
  return bytes;
}

Result<PathSnapshot> decodePath(ByteView bytes) {
  ByteReader from(bytes);
  const auto version = from.get<std::uint8_t>();
  if (from.ok() && version != kPathVersion)
    return Error{ErrorCode::kVersion,
                 fmt::format("path in a body: version {}, this program reads {}", version, kPathVersion)};
  PathSnapshot snapshot;
  PathLayers& path = snapshot.path;
  path.count = from.get<std::uint8_t>();
  path.bones.count = from.get<std::uint8_t>();
  snapshot.tick = from.get<std::uint64_t>();
  path.point_W_m = vectorFrom(from);
  path.normal_W = vectorFrom(from);
  path.changes_from_m = from.get<double>();
  if (!from.ok()) return corruptPath(fmt::format("{} bytes are too few", bytes.size()));
  if (path.count == 0 || path.count > kMaxStackLayers || path.bones.count > kMaxBonePlanes)
    return corruptPath(fmt::format("{} layers and {} bones, allowed are 1 to {} and 0 to {}", path.count,
                                   path.bones.count, kMaxStackLayers, kMaxBonePlanes));
  if (!isPlane(path.point_W_m, path.normal_W)) return corruptPath("the skin is not a plane");
  if (!(path.changes_from_m >= 0)) return corruptPath("where it changes is not a depth");
  double before_m = 0;
  for (std::uint32_t i = 0; i < path.count; ++i) {
    LayerStack::Layer& layer = path.layers[i];
    layer.structure = from.get<std::uint8_t>();
    layer.top_m = from.get<double>();
    if (!from.ok()) return corruptPath(fmt::format("{} bytes are too few", bytes.size()));
    const bool ascends = i == 0 ? layer.top_m == 0 : layer.top_m > before_m && layer.top_m <= 1;
    const bool known =
        layer.structure < kMaxLayers || (layer.structure == kOutside && i > 0 && i + 1 == path.count);
    if (!ascends || !known) return corruptPath(fmt::format("layer {} has a wrong top or structure", i));
    before_m = layer.top_m;
  }
  for (std::size_t i = 0; i < path.bones.count; ++i) {
    BonePlane& plane = path.bones.planes[i];
    plane.point_m = vectorFrom(from);
    plane.normal = vectorFrom(from);
    plane.structure = from.get<std::uint8_t>();
    if (!from.ok()) return corruptPath(fmt::format("{} bytes are too few", bytes.size()));
    if (!isPlane(plane.point_m, plane.normal) || plane.structure >= kMaxLayers)
      return corruptPath(fmt::format("bone {} is not a plane of a structure", i));
  }
  if (from.left() != 0) return corruptPath(fmt::format("{} bytes are left over", from.left()));
  return snapshot;
}

bool appendPath(const PathSnapshot& snapshot, Bytes& list) {
  const Bytes path = encodePath(snapshot);
  if (list.size() + 2 + path.size() > kMaxPathListBytes) return false;
  ByteWriter to(list);
  to.put(static_cast<std::uint16_t>(path.size()));
  list.insert(list.end(), path.begin(), path.end());
  return true;
}

std::vector<PathSnapshot> pathsIn(ByteView list) {
  std::vector<PathSnapshot> paths;
  if (list.size() > kMaxPathListBytes) return paths;
  for (ByteReader from(list); from.left() > 0;) {
    const std::size_t length = from.get<std::uint16_t>();
    const ByteView bytes = from.take(length);
    if (!from.ok()) break;
    if (auto path = decodePath(bytes); path.ok()) paths.push_back(*std::move(path));
  }
  return paths;
}

}  // namespace needlelab
