/// Keys by GLFW's numbers, as a surface reports them in a window and off screen.
#pragma once

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <imgui/imgui.h>

namespace needlelab {

inline bool enterPressed() {
  return ImGui::IsKeyPressed(GLFW_KEY_ENTER, false) || ImGui::IsKeyPressed(GLFW_KEY_KP_ENTER, false);
}

}  // namespace needlelab
