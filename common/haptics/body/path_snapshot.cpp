#include "common/haptics/body/path_snapshot.h"

#include <cassert>
#include <cmath>

#include <fmt/core.h>

#include "common/haptics/vector_bytes.h"

namespace needlelab {
namespace {

constexpr std::uint8_t kPathVersion = 2;  // version 1 had planes of bone

Error corruptPath(const std::string& what) {
  return {ErrorCode::kCorrupt, "path in a body: " + what};
}

bool isPlane(Vec3 point_m, Vec3 normal) {
  return isFinite(point_m) && isDirection(normal);
}

}  // namespace

Bytes encodePath(const PathSnapshot& snapshot) {
  const PathLayers& path = snapshot.path;
  assert(path.count <= kMaxStackLayers);
  Bytes bytes;
  bytes.reserve(kMaxPathBytes);
  ByteWriter to(bytes);
  to.put(kPathVersion);
  to.put(static_cast<std::uint8_t>(path.count));
  to.put(snapshot.tick);
  putVector(to, path.point_W_m);
  putVector(to, path.normal_W);
  putVector(to, path.ball_W_m);
  to.put(path.ball_radius_m);
  to.put(path.asked_depth_m);
  for (std::uint32_t i = 0; i < path.count; ++i) {
    to.put(path.layers[i].structure);
    to.put(path.layers[i].top_m);
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
  snapshot.tick = from.get<std::uint64_t>();
  path.point_W_m = vectorFrom(from);
  path.normal_W = vectorFrom(from);
  path.ball_W_m = vectorFrom(from);
  path.ball_radius_m = from.get<double>();
  path.asked_depth_m = from.get<double>();
  if (!from.ok()) return corruptPath(fmt::format("{} bytes are too few", bytes.size()));
  if (path.count == 0 || path.count > kMaxStackLayers)
    return corruptPath(fmt::format("{} layers, allowed are 1 to {}", path.count, kMaxStackLayers));
  if (!isPlane(path.point_W_m, path.normal_W)) return corruptPath("the skin is not a plane");
  if (!isFinite(path.ball_W_m) || !(path.ball_radius_m >= 0 && path.ball_radius_m <= 1))
    return corruptPath("where the tip is expected is not a ball");
  if (!(path.asked_depth_m >= 0 && path.asked_depth_m <= 1))
    return corruptPath("where it was asked for is not a depth");
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
