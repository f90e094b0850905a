#include "client/view/model/ultrasound/tissue_echoes.h"

#include <algorithm>
#include <cmath>

#include "common/anatomy/field_body.h"
#include "common/profile/structure_kinds.h"

namespace needlelab {
namespace {

constexpr double kDepthStep_m = 0.00005;  // step of the table over depth

/// Strength and width of the line where a layer or structure begins.
struct Line {
  float strength = 0;
  double wide_m = 0;
};
Line lineOf(const LayerView& layer) {
  const bool bone = layer.kind == pb::Volume::Structure::BONE;
  return {bone ? 0.75F : layer.has_membrane ? 0.5F : 0.3F, bone ? 0.0006 : 0.0003};
}

}  // namespace

Echo echoOf(pb::Volume::Structure::Kind kind) {
  const StructureKind& row = structureKind(kind);
  return {row.echo, row.grain, kind == pb::Volume::Structure::BONE};
}

Echo echoOf(pb::Hazard::Kind kind) {
  switch (kind) {
    case pb::Hazard::BONE:
      return echoOf(pb::Volume::Structure::BONE);
    case pb::Hazard::NERVE:
      return echoOf(pb::Volume::Structure::NERVE);
    case pb::Hazard::VESSEL:
      return echoOf(pb::Volume::Structure::ARTERY);
    default:
      return {0.6F, 0.5F, false};
  }
}

EchoTable::EchoTable(const SceneView& scene, double deepest_m) {
  echoes_.resize(static_cast<std::size_t>(deepest_m / kDepthStep_m) + 2);
  for (std::size_t i = 0; i < echoes_.size(); ++i) {
    const double depth_m = (static_cast<double>(i) + 0.5) * kDepthStep_m;
    echoes_[i].echo =
        echoOf(scene.layers[static_cast<std::size_t>(std::max(0, layerAt(scene, depth_m)))].kind);
  }
  for (const LayerView& layer : scene.layers) {
    const auto [strength, wide_m] = lineOf(layer);
    const double first_m = std::max(0.0, layer.top_m - 3 * wide_m);
    for (auto i = static_cast<std::size_t>(first_m / kDepthStep_m); i < echoes_.size(); ++i) {
      const double away = ((static_cast<double>(i) + 0.5) * kDepthStep_m - layer.top_m) / wide_m;
      if (away > 3) break;
      float& line = echoes_[i].line;
      line = std::max(line, strength * static_cast<float>(std::exp(-away * away)));
    }
  }
}

const TissueEcho& EchoTable::at(double depth_m) const {
  return echoes_[std::min(static_cast<std::size_t>(depth_m / kDepthStep_m), echoes_.size() - 1)];
}

BodyEchoes::BodyEchoes(const SceneView& scene, const SlicePlane& plane, const GreyImage& picture,
                       double m_per_px)
    : width_(picture.width), height_(picture.height) {
  const Vec3 across_W_m = plane.right_W * (m_per_px * width_), down_W_m = plane.down_W * (m_per_px * height_);
  const SectionFrame frame_W{plane.origin_W_m - across_W_m * 0.5 + down_W_m, across_W_m, -down_W_m, width_,
                             height_};
  const Pose X_LW = inverse(scene.X_WL);
  section_ = sectionOf(scene.body->field(), {X_LW * frame_W.corner_m, rotate(X_LW.q, frame_W.across_m),
                                             rotate(X_LW.q, frame_W.upward_m), width_, height_});
  for (const LayerView& structure : scene.layers) echoes_.push_back(echoOf(structure.kind));
  drawLines(scene, m_per_px);
}

std::optional<TissueEcho> BodyEchoes::at(int x, int y) const {
  const StructureIndex structure = structureAt(x, y);
  if (structure == kOutside) return std::nullopt;
  return TissueEcho{echoes_[structure], lines_[indexOf(x, y)]};
}

std::size_t BodyEchoes::indexOf(int x, int y) const {
  return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x);
}

// where sound comes into another structure; nothing is heard of where it leaves a bone
void BodyEchoes::drawLines(const SceneView& scene, double m_per_px) {
  lines_.assign(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_), 0.0F);
  for (int x = 0; x < width_; ++x) {
    for (int y = 1; y < height_; ++y) {
      const StructureIndex before = structureAt(x, y - 1), here = structureAt(x, y);
      if (here == before || here == kOutside || (before != kOutside && echoes_[before].stops_sound)) continue;
      const auto [strength, wide_m] = lineOf(scene.layers[here]);
      const int reach_px = static_cast<int>(3 * wide_m / m_per_px);
      for (int row = std::max(0, y - reach_px); row <= std::min(height_ - 1, y + reach_px); ++row) {
        const double away = (row + 0.5 - y) * m_per_px / wide_m;
        float& line = lines_[indexOf(x, row)];
        line = std::max(line, strength * static_cast<float>(std::exp(-away * away)));
      }
    }
  }
}

}  // namespace needlelab
