/// How tissues look to ultrasound: their echoes, and the bright lines where they begin.
#pragma once

#include <optional>
#include <vector>

#include "client/view/model/mesh.h"
#include "client/view/model/scene_view.h"
#include "client/view/model/ultrasound/ultrasound_slice.h"
#include "common/anatomy/field_section.h"

namespace needlelab {

/// A structure's echo: 0 black to 1 white, and its grain.
struct Echo {
  float mean = 0.3F, grain = 0.5F;
  bool stops_sound = false;
};
Echo echoOf(pb::Volume::Structure::Kind kind);
/// Of a hazard that is a ball or a line.
Echo echoOf(pb::Hazard::Kind kind);

/// What a pixel shows of the tissue: its echo, and the line where a layer or structure begins.
struct TissueEcho {
  Echo echo;
  float line = 0;
};

/// Shells: echoes by depth below the skin, one look-up per pixel.
class EchoTable {
 public:
  EchoTable(const SceneView& scene, double deepest_m);
  [[nodiscard]] const TissueEcho& at(double depth_m) const;

 private:
  std::vector<TissueEcho> echoes_;
};

/// A body: echoes of the structures that the plane cuts.
class BodyEchoes {
 public:
  /// `scene` has a body. `picture`: its size only.
  BodyEchoes(const SceneView& scene, const SlicePlane& plane, const GreyImage& picture, double m_per_px);
  /// `y` from the top. Outside of the skin: nothing.
  [[nodiscard]] std::optional<TissueEcho> at(int x, int y) const;

 private:
  [[nodiscard]] std::size_t indexOf(int x, int y) const;
  [[nodiscard]] StructureIndex structureAt(int x, int y) const { return section_.at(x, height_ - 1 - y); }
  void drawLines(const SceneView& scene, double m_per_px);

  int width_, height_;
  FieldSection section_;
  std::vector<Echo> echoes_;  // by structure
  std::vector<float> lines_;  // by pixel, rows from the top
};

}  // namespace needlelab
