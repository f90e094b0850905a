#include "client/view/gl_program.h"

#include <epoxy/gl.h>

#include <array>
#include <cstddef>

namespace needlelab {
namespace {

Result<unsigned> compiledShader(GLenum kind, const char* name, const char* source) {
  const GLuint shader = glCreateShader(kind);
  glShaderSource(shader, 1, &source, nullptr);
  glCompileShader(shader);
  GLint ok = 0;
  glGetShaderiv(shader, GL_COMPILE_STATUS, &ok);
  if (ok != 0) return shader;
  std::array<char, 1024> words{};
  glGetShaderInfoLog(shader, static_cast<GLsizei>(words.size()) - 1, nullptr, words.data());
  glDeleteShader(shader);
  return Error{ErrorCode::kUnavailable,
               std::string("the graphics driver does not take the shader '") + name + "': " + words.data()};
}

}  // namespace

GlProgram::~GlProgram() {
  if (program_ != 0) glDeleteProgram(program_);
}

Status GlProgram::build(const char* name, const char* vertex_source, const char* fragment_source) {
  const Result<unsigned> vertex = compiledShader(GL_VERTEX_SHADER, name, vertex_source);
  if (!vertex) return vertex.error();
  const Result<unsigned> fragment = compiledShader(GL_FRAGMENT_SHADER, name, fragment_source);
  if (!fragment) {
    glDeleteShader(*vertex);
    return fragment.error();
  }
  program_ = glCreateProgram();
  glAttachShader(program_, *vertex);
  glAttachShader(program_, *fragment);
  glLinkProgram(program_);
  glDeleteShader(*vertex);
  glDeleteShader(*fragment);
  GLint ok = 0;
  glGetProgramiv(program_, GL_LINK_STATUS, &ok);
  if (ok != 0) return {};
  std::array<char, 1024> words{};
  glGetProgramInfoLog(program_, static_cast<GLsizei>(words.size()) - 1, nullptr, words.data());
  return Error{ErrorCode::kUnavailable,
               std::string("the graphics driver does not link the shader '") + name + "': " + words.data()};
}

void GlProgram::use() const {
  glUseProgram(program_);
}

int GlProgram::place(const char* name) const {
  return glGetUniformLocation(program_, name);
}
void GlProgram::set(const char* name, float value) const {
  glUniform1f(place(name), value);
}
void GlProgram::set(const char* name, int value) const {
  glUniform1i(place(name), value);
}
void GlProgram::set(const char* name, Vec3 value) const {
  glUniform3f(place(name), static_cast<float>(value.x), static_cast<float>(value.y),
              static_cast<float>(value.z));
}
void GlProgram::set(const char* name, Rgb colour, float opacity) const {
  glUniform4f(place(name), colour.red, colour.green, colour.blue, opacity);
}
void GlProgram::set(const char* name, const Matrix4& value) const {
  glUniformMatrix4fv(place(name), 1, GL_FALSE, value.data());
}

GlMesh::~GlMesh() {
  if (array_ != 0) glDeleteVertexArrays(1, &array_);
  if (vertices_ != 0) glDeleteBuffers(1, &vertices_);
  if (indices_ != 0) glDeleteBuffers(1, &indices_);
}

void GlMesh::upload(const Mesh& mesh) {
  if (array_ == 0) {
    glGenVertexArrays(1, &array_);
    glGenBuffers(1, &vertices_);
    glGenBuffers(1, &indices_);
  }
  glBindVertexArray(array_);
  glBindBuffer(GL_ARRAY_BUFFER, vertices_);
  glBufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(mesh.vertices.size() * sizeof(MeshVertex)),
               mesh.vertices.data(), GL_STATIC_DRAW);
  glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, indices_);
  glBufferData(GL_ELEMENT_ARRAY_BUFFER,
               static_cast<GLsizeiptr>(mesh.triangles.size() * sizeof(std::uint32_t)), mesh.triangles.data(),
               GL_STATIC_DRAW);
  glEnableVertexAttribArray(0);
  glVertexAttribPointer(0, 3, GL_FLOAT, GL_FALSE, sizeof(MeshVertex), nullptr);
  glEnableVertexAttribArray(1);
  glVertexAttribPointer(1, 3, GL_FLOAT, GL_FALSE, sizeof(MeshVertex),
                        reinterpret_cast<const void*>(offsetof(MeshVertex, normal)));
  glBindVertexArray(0);
  count_ = static_cast<int>(mesh.triangles.size());
}

void GlMesh::draw() const {
  if (count_ == 0) return;
  glBindVertexArray(array_);
  glDrawElements(GL_TRIANGLES, count_, GL_UNSIGNED_INT, nullptr);
  glBindVertexArray(0);
}

}  // namespace needlelab
