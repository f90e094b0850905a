// Opaque rectangles without a texture or blending: llvmpipe clears them at a tenth of what ImGui's own cost.
#include <epoxy/gl.h>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <deque>

#include "client/view/redraw.h"
#include "client/view/surface_pixels.h"
#include "client/view/theme.h"

namespace needlelab {
namespace {

struct SolidJob {
  ImVec2 from_px, to_px;
  Rgb colour;
};

// of the frame under way; ImGui's lists refer to them until the next frame begins
SolidJob& newJob() {
  static std::deque<SolidJob> jobs;
  static int frame = -1;
  if (frame != ImGui::GetFrameCount()) jobs.clear();
  frame = ImGui::GetFrameCount();
  return jobs.emplace_back();
}

void clearRect(const ImDrawList*, const ImDrawCmd* command) {
  const SolidJob& job = *static_cast<const SolidJob*>(command->UserCallbackData);
  const PixelRect part = surfacePixels(job.from_px, job.to_px, command->ClipRect);
  if (part.empty()) return;
  glScissor(part.x, part.y, part.width, part.height);
  glClearColor(job.colour.red, job.colour.green, job.colour.blue, 1);
  glClear(GL_COLOR_BUFFER_BIT);
}

}  // namespace

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

void solidRect(ImDrawList& list, ImVec2 from_px, ImVec2 to_px, Rgb colour) {
  SolidJob& job = newJob();
  job = {from_px, to_px, colour};
  for (const float number : {from_px.x, from_px.y, to_px.x, to_px.y, colour.red, colour.green, colour.blue})
    noteContent(std::bit_cast<std::uint32_t>(number));
  list.AddCallback(&clearRect, &job);
}

}  // namespace needlelab
