#include "client/view/gl_objects.h"

#include <epoxy/gl.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <utility>

namespace needlelab {
namespace {

// of the process's only surface
std::uint64_t texture_changes = 0, content = 0;

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
               std::string("the graphics driver rejects the shader '") + name + "': " + words.data()};
}

}  // namespace

GlProgram::~GlProgram() {
  if (program_ != 0) glDeleteProgram(program_);
}

Status GlProgram::build(const char* name, const char* vertex_source, const char* fragment_source) {
  ASSIGN_OR_RETURN(const auto vertex, compiledShader(GL_VERTEX_SHADER, name, vertex_source));
  const Result<unsigned> fragment = compiledShader(GL_FRAGMENT_SHADER, name, fragment_source);
  if (!fragment) {
    glDeleteShader(vertex);
    return fragment.error();
  }
  program_ = glCreateProgram();
  glAttachShader(program_, vertex);
  glAttachShader(program_, *fragment);
  glLinkProgram(program_);
  glDeleteShader(vertex);
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

int GlProgram::location(const char* name) const {
  return glGetUniformLocation(program_, name);
}
void GlProgram::set(const char* name, float value) const {
  glUniform1f(location(name), value);
}
void GlProgram::set(const char* name, int value) const {
  glUniform1i(location(name), value);
}
void GlProgram::set(const char* name, Vec3 value) const {
  glUniform3f(location(name), static_cast<float>(value.x), static_cast<float>(value.y),
              static_cast<float>(value.z));
}
void GlProgram::set(const char* name, Vec3 value, double fourth) const {
  glUniform4f(location(name), static_cast<float>(value.x), static_cast<float>(value.y),
              static_cast<float>(value.z), static_cast<float>(fourth));
}
void GlProgram::set(const char* name, Rgb colour, float opacity) const {
  glUniform4f(location(name), colour.red, colour.green, colour.blue, opacity);
}
void GlProgram::set(const char* name, const Matrix4& value) const {
  glUniformMatrix4fv(location(name), 1, GL_FALSE, value.data());
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

PixelRect joined(PixelRect a, PixelRect b) {
  if (a.empty()) return b;
  if (b.empty()) return a;
  const int x = std::min(a.x, b.x), y = std::min(a.y, b.y);
  return {x, y, std::max(a.x + a.width, b.x + b.width) - x, std::max(a.y + a.height, b.y + b.height) - y};
}

FrameBuffer::~FrameBuffer() {
  drop();
}

void FrameBuffer::drop() {
  if (texture_ != 0) glDeleteTextures(1, &texture_);
  if (resolved_ != 0) glDeleteFramebuffers(1, &resolved_);
  if (drawn_ != 0) glDeleteFramebuffers(1, &drawn_);
  if (colour_ != 0) glDeleteRenderbuffers(1, &colour_);
  if (depth_ != 0) glDeleteRenderbuffers(1, &depth_);
  texture_ = resolved_ = drawn_ = colour_ = depth_ = 0;
}

void FrameBuffer::bind(int width, int height) {
  width = std::clamp(width, 1, 16384);
  height = std::clamp(height, 1, 16384);
  if (width != width_ || height != height_ || texture_ == 0) {
    drop();
    width_ = width;
    height_ = height;
    glGenTextures(1, &texture_);
    glBindTexture(GL_TEXTURE_2D, texture_);
    glTexImage2D(GL_TEXTURE_2D, 0, GL_RGBA8, width, height, 0, GL_RGBA, GL_UNSIGNED_BYTE, nullptr);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    glBindTexture(GL_TEXTURE_2D, 0);
    glGenRenderbuffers(1, &depth_);
    glBindRenderbuffer(GL_RENDERBUFFER, depth_);
    const bool several = samples_ > 1;
    if (several)
      glRenderbufferStorageMultisample(GL_RENDERBUFFER, samples_, GL_DEPTH_COMPONENT24, width, height);
    else
      glRenderbufferStorage(GL_RENDERBUFFER, GL_DEPTH_COMPONENT24, width, height);
    glGenFramebuffers(1, &resolved_);
    glBindFramebuffer(GL_FRAMEBUFFER, resolved_);
    glFramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, texture_, 0);
    if (several) {
      glGenRenderbuffers(1, &colour_);
      glBindRenderbuffer(GL_RENDERBUFFER, colour_);
      glRenderbufferStorageMultisample(GL_RENDERBUFFER, samples_, GL_RGBA8, width, height);
      glGenFramebuffers(1, &drawn_);
      glBindFramebuffer(GL_FRAMEBUFFER, drawn_);
      glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, colour_);
    }
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, depth_);
  }
  glBindFramebuffer(GL_FRAMEBUFFER, drawn_ != 0 ? drawn_ : resolved_);
  glViewport(0, 0, width_, height_);
}

void FrameBuffer::copyFrom(const FrameBuffer& other, PixelRect part) {
  if (part.empty()) return;
  glBindFramebuffer(GL_READ_FRAMEBUFFER, other.drawn_ != 0 ? other.drawn_ : other.resolved_);
  glBindFramebuffer(GL_DRAW_FRAMEBUFFER, drawn_ != 0 ? drawn_ : resolved_);
  const int x1 = part.x + part.width, y1 = part.y + part.height;
  glBlitFramebuffer(part.x, part.y, x1, y1, part.x, part.y, x1, y1, GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT,
                    GL_NEAREST);
}

void FrameBuffer::resolve() {
  resolve(whole());
}

void FrameBuffer::resolve(PixelRect part) {
  if (drawn_ != 0 && !part.empty()) {
    const int x1 = part.x + part.width, y1 = part.y + part.height;
    glBindFramebuffer(GL_READ_FRAMEBUFFER, drawn_);
    glBindFramebuffer(GL_DRAW_FRAMEBUFFER, resolved_);
    glBlitFramebuffer(part.x, part.y, x1, y1, part.x, part.y, x1, y1, GL_COLOR_BUFFER_BIT, GL_NEAREST);
  }
  glBindFramebuffer(GL_FRAMEBUFFER, 0);
}

void FrameBuffer::showAt(int x, int y) const {
  glBindFramebuffer(GL_READ_FRAMEBUFFER, resolved_);
  glBlitFramebuffer(0, 0, width_, height_, x, y, x + width_, y + height_, GL_COLOR_BUFFER_BIT, GL_NEAREST);
  glBindFramebuffer(GL_READ_FRAMEBUFFER, 0);
}

RgbaImage FrameBuffer::read() {
  RgbaImage image;
  if (texture_ == 0) return image;
  image.width = width_;
  image.height = height_;
  const auto row = 4 * static_cast<std::size_t>(width_);
  std::vector<std::uint8_t> upward(row * static_cast<std::size_t>(height_));
  glBindFramebuffer(GL_READ_FRAMEBUFFER, resolved_);
  glPixelStorei(GL_PACK_ALIGNMENT, 1);
  glReadPixels(0, 0, width_, height_, GL_RGBA, GL_UNSIGNED_BYTE, upward.data());
  glBindFramebuffer(GL_READ_FRAMEBUFFER, 0);
  // OpenGL's first row is at the bottom
  image.pixels.resize(upward.size());
  for (std::size_t y = 0; y < static_cast<std::size_t>(height_); ++y)
    std::memcpy(&image.pixels[y * row], &upward[(static_cast<std::size_t>(height_) - 1 - y) * row], row);
  return image;
}

void noteTextureChange() {
  ++texture_changes;
}

void noteContent(std::uint64_t word) {
  content = (content ^ word) * 0x100000001B3u;
  content ^= content >> 29;
}

namespace {

// FNV hash over 64-bit words of the frame's draw data
std::uint64_t hashOfBytes(const void* data, std::size_t size, std::uint64_t hash) {
  const auto* bytes = static_cast<const unsigned char*>(data);
  for (; size >= 8; size -= 8, bytes += 8) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes, 8);
    hash = (hash ^ word) * 0x100000001B3u;
    hash ^= hash >> 29;
  }
  for (; size > 0; --size, ++bytes) hash = (hash ^ *bytes) * 0x100000001B3u;
  return hash;
}

}  // namespace

std::uint64_t hashOfFrame(const ImDrawData& data, int width_px, int height_px) {
  std::uint64_t hash = (0xCBF29CE484222325u ^ std::exchange(content, 0)) * 0x100000001B3u ^ texture_changes;
  hash =
      (hash ^ static_cast<std::uint64_t>(width_px)) * 0x100000001B3u ^ static_cast<std::uint64_t>(height_px);
  for (int i = 0; i < data.CmdListsCount; ++i) {
    const ImDrawList& list = *data.CmdLists[i];
    hash = hashOfBytes(list.VtxBuffer.Data, static_cast<std::size_t>(list.VtxBuffer.size_in_bytes()), hash);
    hash = hashOfBytes(list.IdxBuffer.Data, static_cast<std::size_t>(list.IdxBuffer.size_in_bytes()), hash);
    for (const ImDrawCmd& command : list.CmdBuffer) {
      hash = hashOfBytes(&command.ClipRect, sizeof command.ClipRect, hash);
      hash = (hash ^ reinterpret_cast<std::uintptr_t>(command.TextureId)) * 0x100000001B3u;
    }
  }
  return hash;
}

Texture::~Texture() {
  if (name_ != 0) glDeleteTextures(1, &name_);
}

Texture::Texture(Texture&& other) noexcept {
  *this = std::move(other);
}

Texture& Texture::operator=(Texture&& other) noexcept {
  std::swap(name_, other.name_);
  std::swap(width_, other.width_);
  std::swap(height_, other.height_);
  std::swap(grey_, other.grey_);
  return *this;
}

void Texture::upload(const GreyImage& image) {
  put(image.width, image.height, true, image.pixels.data());
}

void Texture::upload(const RgbaImage& image) {
  put(image.width, image.height, false, image.pixels.data());
}

void Texture::put(int width, int height, bool grey, const void* pixels) {
  noteTextureChange();
  if (width <= 0 || height <= 0) {
    Texture empty;
    *this = std::move(empty);
    return;
  }
  const bool fresh = name_ == 0 || width != width_ || height != height_ || grey != grey_;
  if (name_ == 0) glGenTextures(1, &name_);
  glBindTexture(GL_TEXTURE_2D, name_);
  // rows of one-byte pixels need not be 4-byte aligned
  glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
  const GLenum format = grey ? GL_RED : GL_RGBA;
  if (fresh) {
    glTexImage2D(GL_TEXTURE_2D, 0, grey ? GL_R8 : GL_RGBA8, width, height, 0, format, GL_UNSIGNED_BYTE,
                 pixels);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
    // show one channel as opaque grey
    const GLint swizzle[4] = {GL_RED, grey ? GL_RED : GL_GREEN, grey ? GL_RED : GL_BLUE,
                              grey ? GL_ONE : GL_ALPHA};
    glTexParameteriv(GL_TEXTURE_2D, GL_TEXTURE_SWIZZLE_RGBA, swizzle);
  } else {
    glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, width, height, format, GL_UNSIGNED_BYTE, pixels);
  }
  glPixelStorei(GL_UNPACK_ALIGNMENT, 4);
  glBindTexture(GL_TEXTURE_2D, 0);
  width_ = width;
  height_ = height;
  grey_ = grey;
}

ImTextureID Texture::id() const {
  return reinterpret_cast<ImTextureID>(static_cast<std::uintptr_t>(name_));
}

PixelRect surfacePixels(ImVec2 from, ImVec2 to, ImVec4 clip) {
  GLint viewport[4] = {};
  glGetIntegerv(GL_VIEWPORT, viewport);
  const ImGuiIO& io = ImGui::GetIO();
  const float scale_x = static_cast<float>(viewport[2]) / std::max(io.DisplaySize.x, 1.0F);
  const float scale_y = static_cast<float>(viewport[3]) / std::max(io.DisplaySize.y, 1.0F);
  const int left = static_cast<int>(std::max(from.x, clip.x) * scale_x);
  const int right = static_cast<int>(std::min(to.x, clip.z) * scale_x);
  const int top = static_cast<int>(std::max(from.y, clip.y) * scale_y);
  const int bottom = static_cast<int>(std::min(to.y, clip.w) * scale_y);
  return {left, viewport[3] - bottom, right - left, bottom - top};
}

}  // namespace needlelab
