/// The scene's shaders. Private to this folder.
#pragma once

namespace needlelab {

// things with a surface: lit from the eye's upper left, with a highlight and a rim that tells edges apart
inline constexpr const char* kSolidVertex = R"(#version 330 core
layout(location = 0) in vec3 place;
layout(location = 1) in vec3 normal;
uniform mat4 view_projection;
uniform mat4 model;
out vec3 p_W;
out vec3 n_W;
void main() {
  vec4 world = model * vec4(place, 1.0);
  p_W = world.xyz;
  n_W = mat3(model) * normal;
  gl_Position = view_projection * world;
})";
inline constexpr const char* kSolidFragment = R"(#version 330 core
in vec3 p_W;
in vec3 n_W;
uniform vec4 colour;
uniform vec3 eye_W;
uniform vec3 light_W;      // toward the light
uniform float shine;       // of the highlight
uniform float rim;         // more opaque at the edges: glass
uniform int cut;           // 1: only what is behind the cut; -1: only what is before it
uniform vec3 cut_place_W;
uniform vec3 cut_normal_W; // toward the eye
out vec4 shown;
void main() {
  float before = dot(p_W - cut_place_W, cut_normal_W);
  if (cut != 0 && before * float(cut) > 0.0) discard;
  vec3 to_eye = normalize(eye_W - p_W);
  vec3 n = normalize(n_W);
  if (dot(n, to_eye) < 0.0) n = -n;
  float lit = max(dot(n, light_W), 0.0);
  float soft = 0.5 + 0.5 * dot(n, light_W);
  float edge = 1.0 - abs(dot(n, to_eye));
  vec3 half_way = normalize(light_W + to_eye);
  // to the 48th, without a logarithm
  float g = max(dot(n, half_way), 0.0);
  g *= g;
  g *= g;
  g *= g;
  g *= g;
  float glint = shine * g * g * g;
  vec3 light = colour.rgb * (0.30 + 0.30 * soft + 0.48 * lit) + vec3(glint);
  float opacity = mix(colour.a, min(1.0, colour.a + rim), edge * edge);
  shown = vec4(light, opacity);
})";

// the cut: a flat sheet whose colour is the tissue's at that depth
inline constexpr const char* kSectionVertex = R"(#version 330 core
layout(location = 0) in vec3 place;  // x across, y up, in the unit square
uniform mat4 view_projection;
uniform vec3 corner_W;
uniform vec3 across_W;
uniform vec3 upward_W;
out vec3 p_W;
out vec2 at;
void main() {
  p_W = corner_W + across_W * place.x + upward_W * place.y;
  at = place.xy;
  gl_Position = view_projection * vec4(p_W, 1.0);
})";
inline constexpr const char* kSectionFragment = R"(#version 330 core
in vec3 p_W;
in vec2 at;
uniform int shape;          // 0 plane, 1 sphere, 2 capsule
uniform vec3 a_W;
uniform vec3 b_W;
uniform float radius;
uniform vec3 normal_W;
uniform float deepest;      // of the table
uniform float period;       // of the table, along the layers
uniform vec3 along_W;
uniform float fades;        // 1: ends softly at the sides and below
uniform sampler2D table;
out vec4 shown;
void main() {
  float depth;
  if (shape == 0) {
    depth = -dot(normal_W, p_W - a_W);
  } else {
    vec3 ab = b_W - a_W;
    float t = shape == 1 ? 0.0 : clamp(dot(p_W - a_W, ab) / dot(ab, ab), 0.0, 1.0);
    depth = radius - distance(p_W, a_W + ab * t);
  }
  if (depth <= 0.0) discard;
  vec3 tissue = texture(table, vec2(depth / deepest, dot(p_W, along_W) / period)).rgb;
  float opacity = 1.0;
  if (fades > 0.0) {
    float side = abs(at.x - 0.5) * 2.0;
    opacity = (1.0 - smoothstep(0.80, 1.0, side)) * smoothstep(0.0, 0.10, at.y);
  }
  shown = vec4(tissue, opacity);
})";

// behind everything: a little lighter in the middle, so that the dark syringe stands out
inline constexpr const char* kBackdropVertex = R"(#version 330 core
layout(location = 0) in vec3 place;
out vec2 at;
void main() {
  at = place.xy;
  gl_Position = vec4(place.xy * 2.0 - 1.0, 0.99999, 1.0);
})";
inline constexpr const char* kBackdropFragment = R"(#version 330 core
in vec2 at;
uniform vec4 low;
uniform vec4 high;
out vec4 shown;
void main() {
  shown = mix(low, high, at.y);
})";

}  // namespace needlelab
