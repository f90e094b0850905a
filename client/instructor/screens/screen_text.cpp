#include "client/instructor/screens/screen_text.h"

#include <imgui/imgui.h>
#include <imgui/imgui_internal.h>

namespace needlelab {

ScreenText::ScreenText() {
  ImGui::LogToBuffer();
}

ScreenText::~ScreenText() {
  ImGui::LogFinish();
}

std::string ScreenText::take() {
  const ImGuiTextBuffer& buffer = ImGui::GetCurrentContext()->LogBuffer;
  std::string text(buffer.begin(), buffer.end());
  ImGui::LogFinish();
  return text;
}

std::string flatText(const std::string& text) {
  std::string flat;
  for (const char c : text) {
    const bool blank = c == ' ' || c == '\n' || c == '\r' || c == '\t';
    if (blank && (flat.empty() || flat.back() == ' ')) continue;
    flat += blank ? ' ' : c;
  }
  return flat;
}

}  // namespace needlelab
