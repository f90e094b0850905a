/// Keys by GLFW's numbers, as a surface reports them in a window and off screen. The keys of actions stand in
/// station_actions.h.
#pragma once

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <imgui/imgui.h>
