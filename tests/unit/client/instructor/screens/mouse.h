/// A mouse for the instructor's off-screen window.
#pragma once

#include "tests/unit/client/instructor/screens/window_lab.h"

#include <imgui/imgui.h>
#include <imgui/imgui_internal.h>

#include <optional>
#include <string>
#include <vector>

namespace needlelab::test {

/// Finds a widget by its label, wherever it is, and clicks on it like a user: disabled, hidden or covered
/// widgets do not react.
class WithMouse : public WindowLab {
 protected:
  void logIn() {
    lab_->logIn();
    ASSERT_TRUE(until([&] { return lab_->inside(); })) << window_->text();
  }

  /// Clicks at a position in pixels.
  void clickAt(ImVec2 place) {
    surface_->moveMouse(static_cast<double>(place.x), static_cast<double>(place.y));
    frame();
    surface_->setMouseButton(0, true);
    frame();
    surface_->setMouseButton(0, false);
    frames(2);
  }
  /// Clicks on the widget with this label (including what follows its "##"); `row`: in a table. Returns
  /// whether it exists.
  bool click(const std::string& label, std::optional<int> row = {}) {
    const auto place = placeOf(label, row);
    if (place) clickAt(*place);
    return place.has_value();
  }
  /// Clicks on a station's tile. Returns whether it exists.
  bool clickTile(const std::string& station) {
    for (ImGuiWindow* const parent : windows()) {
      const ImGuiID id = ImHashStr("tile", 0, ImHashStr(station.c_str(), 0, parent->ID));
      for (ImGuiWindow* const tile : windows()) {
        if (tile->ParentWindow != parent || tile->ChildId != id) continue;
        clickAt(tile->Rect().GetCenter());
        return true;
      }
    }
    return false;
  }
  /// Clicks on a column's header in the shown table with this many columns. Returns the direction of its
  /// arrow afterwards; nothing if there is no such table.
  std::optional<ImGuiSortDirection> clickHead(int columns, int column) {
    ImGuiTable* const table = tableOf(columns);
    if (table == nullptr) return {};
    const ImGuiTableColumn& head = table->Columns[column];
    clickAt({0.5F * (head.WorkMinX + head.WorkMaxX), table->OuterRect.Min.y + 6});
    const ImGuiSortDirection arrow = table->Columns[column].SortDirection;
    return arrow;
  }
  void type(const std::string& text) {
    surface_->typeText(text);
    frames(2);
  }
  /// Returns the widget's centre.
  std::optional<ImVec2> placeOf(const std::string& label, std::optional<int> row = {}) {
    for (ImGuiWindow* const window : windows()) {
      std::vector<ImGuiID> seeds = {window->ID};
      for (const ImGuiTable* const table : tables())
        if (table->InnerWindow == window) seeds.push_back(table->ID);
      for (ImGuiID seed : seeds) {
        if (row) seed = ImHashData(&*row, sizeof *row, seed);
        if (const auto place = placeOf(window, ImHashStr(label.c_str(), 0, seed))) return place;
      }
    }
    return {};
  }
  [[nodiscard]] bool stands(const std::string& words) const {
    return window_->text().find(words) != std::string::npos;
  }

 private:
  [[nodiscard]] static std::vector<ImGuiWindow*> windows() {
    std::vector<ImGuiWindow*> shown;
    for (ImGuiWindow* const window : ImGui::GetCurrentContext()->Windows)
      if (window->WasActive) shown.push_back(window);
    return shown;
  }
  [[nodiscard]] static std::vector<ImGuiTable*> tables() {
    std::vector<ImGuiTable*> all;
    auto& pool = ImGui::GetCurrentContext()->Tables;
    for (int i = 0; i < pool.GetMapSize(); ++i)
      if (ImGuiTable* const table = pool.TryGetMapData(i)) all.push_back(table);
    return all;
  }
  [[nodiscard]] static ImGuiTable* tableOf(int columns) {
    for (ImGuiTable* const table : tables())
      if (table->ColumnsCount == columns) return table;
    return nullptr;
  }
  /// The keyboard focus shows where the widget with this ID is.
  std::optional<ImVec2> placeOf(ImGuiWindow* window, ImGuiID id) {
    ImGuiContext& context = *ImGui::GetCurrentContext();
    context.NavWindow = window;
    context.NavId = id;
    context.NavIdIsAlive = false;
    frame();
    // without such a widget the focus moves elsewhere
    const bool there = context.NavIdIsAlive && context.NavId == id && context.NavWindow == window;
    const ImVec2 middle = ImGui::WindowRectRelToAbs(window, window->NavRectRel[0]).GetCenter();
    context.NavId = 0;
    if (!there) return {};
    return middle;
  }
};

}  // namespace needlelab::test
