/// Shaders of a body. A normal's length is how open the surface is to light from all around. Private to this
/// folder.
#pragma once

namespace needlelab {

inline constexpr const char* kBodyVertex = R"(#version 330 core
layout(location = 0) in vec3 place;
layout(location = 1) in vec3 normal;
uniform mat4 view_projection;
uniform mat4 model;
uniform vec3 cut_place_W;
uniform vec3 cut_normal_W;  // out of what is kept; zero: nothing is cut
uniform vec4 ball_W;        // nothing outside of it is drawn: centre, radius; below 0: nothing inside
out vec3 p_W;
out vec3 n_W;
void main() {
  vec4 world = model * vec4(place, 1.0);
  p_W = world.xyz;
  n_W = mat3(model) * normal;
  gl_ClipDistance[0] = dot(cut_place_W - p_W, cut_normal_W);
  gl_ClipDistance[1] = sign(ball_W.w) * (abs(ball_W.w) - distance(p_W, ball_W.xyz));
  gl_Position = view_projection * world;
})";

// the same, pressed in round an entry
inline constexpr const char* kDimpledVertex = R"(#version 330 core
layout(location = 0) in vec3 place;
layout(location = 1) in vec3 normal;
uniform mat4 view_projection;
uniform mat4 model;
uniform vec3 cut_place_W;
uniform vec3 cut_normal_W;
uniform vec4 ball_W;
uniform vec3 dimple_W;
uniform vec3 dimple_normal_W;
uniform float dimple_depth;
uniform float dimple_sigma;
out vec3 p_W;
out vec3 n_W;
void main() {
  vec4 world = model * vec4(place, 1.0);
  vec3 off = world.xyz - dimple_W;
  float down = dimple_depth * exp(-dot(off, off) / (2.0 * dimple_sigma * dimple_sigma));
  vec3 level = off - dimple_normal_W * dot(off, dimple_normal_W);
  world.xyz -= dimple_normal_W * down;
  p_W = world.xyz;
  vec3 n = mat3(model) * normal;
  n_W = length(n) * normalize(normalize(n) - level * (down / (dimple_sigma * dimple_sigma)));
  gl_ClipDistance[0] = dot(cut_place_W - p_W, cut_normal_W);
  gl_ClipDistance[1] = sign(ball_W.w) * (abs(ball_W.w) - distance(p_W, ball_W.xyz));
  gl_Position = view_projection * world;
})";

// skin: light goes on under the surface, red the farthest; a soft highlight; blotches
inline constexpr const char* kSkinFragment = R"(#version 330 core
in vec3 p_W;
in vec3 n_W;
uniform vec4 colour;
uniform vec3 eye_W;
uniform vec3 light_W;
uniform vec3 up_W;
out vec4 shown;
void main() {
  vec3 to_eye = normalize(eye_W - p_W);
  float open = length(n_W);
  vec3 n = n_W / open;
  float facing = dot(n, light_W);
  vec3 wrapped = clamp((vec3(facing) + vec3(0.42, 0.31, 0.27)) / vec3(1.42, 1.31, 1.27), 0.0, 1.0);
  vec3 ambient = mix(vec3(0.25, 0.21, 0.205), vec3(0.37, 0.38, 0.41), 0.5 + 0.5 * dot(n, up_W)) * open;
  float g = max(dot(n, normalize(light_W + to_eye)), 0.0);
  g *= g;
  g *= g;
  g *= g;
  g *= g;
  float edge = 1.0 - max(dot(n, to_eye), 0.0);
  vec3 q = p_W * 160.0;
  float blotch = sin(q.x + 1.3 * sin(1.7 * q.y)) * sin(1.1 * q.y + 1.2 * sin(1.9 * q.z)) + 0.6 * sin(2.3 * q.z + 1.5 * sin(1.3 * q.x));
  vec3 base = colour.rgb * (1.0 - vec3(0.008, 0.020, 0.018) * blotch);
  vec3 lit = base * (ambient + 0.70 * wrapped * (0.4 + 0.6 * open)) + vec3(0.10, 0.095, 0.09) * g;
  lit += base * vec3(0.26, 0.11, 0.07) * edge * edge * edge;
  shown = vec4(lit, colour.a);
})";

// bone, tendon, vessel, glove
inline constexpr const char* kTissueFragment = R"(#version 330 core
in vec3 p_W;
in vec3 n_W;
uniform vec4 colour;
uniform vec3 eye_W;
uniform vec3 light_W;
uniform vec3 up_W;
uniform float shine;
out vec4 shown;
void main() {
  vec3 to_eye = normalize(eye_W - p_W);
  float open = length(n_W);
  vec3 n = n_W / open;
  float wrapped = clamp((dot(n, light_W) + 0.25) / 1.25, 0.0, 1.0);
  float g = max(dot(n, normalize(light_W + to_eye)), 0.0);
  g *= g;
  g *= g;
  g *= g;
  g *= g;
  g *= g;
  float edge = 1.0 - max(dot(n, to_eye), 0.0);
  vec3 ambient = mix(vec3(0.31, 0.30, 0.30), vec3(0.41, 0.42, 0.45), 0.5 + 0.5 * dot(n, up_W)) * open * open;
  vec3 lit = colour.rgb * (ambient + 0.60 * wrapped * (0.35 + 0.65 * open)) + vec3(shine * g) +
             vec3(0.07) * edge * edge * edge;
  shown = vec4(lit, colour.a);
})";

// glass: clear in the middle, more opaque at the edges
inline constexpr const char* kGhostFragment = R"(#version 330 core
in vec3 p_W;
in vec3 n_W;
uniform vec4 colour;
uniform vec3 eye_W;
uniform vec3 light_W;
uniform float rim;
out vec4 shown;
void main() {
  vec3 n = normalize(n_W);
  float edge = 1.0 - abs(dot(n, normalize(eye_W - p_W)));
  float soft = 0.62 + 0.38 * dot(n, light_W);
  shown = vec4(colour.rgb * soft, min(colour.a + rim * edge * edge * edge, 0.95));
})";

// what one sees of the skin's inside: flat, as if it were filled
inline constexpr const char* kInsideFragment = R"(#version 330 core
in vec3 p_W;
in vec3 n_W;
uniform vec4 colour;
out vec4 shown;
void main() {
  shown = colour;
})";

inline constexpr const char* kBodySectionVertex = R"(#version 330 core
layout(location = 0) in vec3 place;  // x across, y up, in the unit square
uniform mat4 view_projection;
uniform vec3 corner_W;
uniform vec3 across_W;
uniform vec3 upward_W;
out vec2 at;
void main() {
  at = place.xy;
  gl_Position = view_projection * vec4(corner_W + across_W * place.x + upward_W * place.y, 1.0);
})";
inline constexpr const char* kBodySectionFragment = R"(#version 330 core
in vec2 at;
uniform sampler2D picture;
out vec4 shown;
void main() {
  shown = texture(picture, at);
  if (shown.a < 0.3) discard;
})";

// a normal's x: from -1 to 1 across the shadow; its y: how dark
inline constexpr const char* kShadowFragment = R"(#version 330 core
in vec3 p_W;
in vec3 n_W;
out vec4 shown;
void main() {
  float across = 1.0 - n_W.x * n_W.x;
  shown = vec4(0.12, 0.03, 0.02, n_W.y * across * across);
})";

}  // namespace needlelab
