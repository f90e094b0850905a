/// A shader program and a mesh on the graphics side. Private to this folder.
#pragma once

#include <initializer_list>
#include <string>

#include "client/view/model/camera.h"
#include "client/view/model/mesh.h"
#include "client/view/model/palette.h"
#include "common/base/result.h"
#include "common/haptics/geometry.h"

namespace needlelab {

/// Needs the context for its whole life. What a program does not have is passed over when it is set.
class GlProgram {
 public:
  GlProgram() = default;
  ~GlProgram();
  GlProgram(const GlProgram&) = delete;
  GlProgram& operator=(const GlProgram&) = delete;

  /// Errors: kUnavailable, with the driver's words.
  Status build(const char* name, const char* vertex_source, const char* fragment_source);
  void use() const;
  void set(const char* name, float value) const;
  void set(const char* name, int value) const;
  void set(const char* name, Vec3 value) const;
  void set(const char* name, Rgb colour, float opacity) const;
  void set(const char* name, const Matrix4& value) const;

 private:
  [[nodiscard]] int place(const char* name) const;
  unsigned program_ = 0;
};

/// Attributes: 0 place, 1 normal.
class GlMesh {
 public:
  GlMesh() = default;
  ~GlMesh();
  GlMesh(const GlMesh&) = delete;
  GlMesh& operator=(const GlMesh&) = delete;

  void upload(const Mesh& mesh);
  void draw() const;
  [[nodiscard]] bool empty() const { return count_ == 0; }

 private:
  unsigned array_ = 0, vertices_ = 0, indices_ = 0;
  int count_ = 0;
};

}  // namespace needlelab
