#include "client/view/window_state.h"

#include <nlohmann/json.hpp>

#include "common/base/files.h"
#include "common/base/text.h"

namespace needlelab {
namespace {

constexpr std::size_t kMostBytes = 4096;

std::optional<double> numberIn(const nlohmann::json& object, const char* name, double least,
                               double greatest) {
  const auto found = object.find(name);
  if (found == object.end() || !found->is_number()) return std::nullopt;
  const double value = found->get<double>();
  if (!(value >= least && value <= greatest)) return std::nullopt;
  return value;
}

}  // namespace

std::optional<WindowState> readWindowState(const std::filesystem::path& file) {
  if (file.empty()) return std::nullopt;
  const Result<std::string> text = readWholeFile(file, kMostBytes);
  if (!text) return std::nullopt;
  const auto json = nlohmann::json::parse(*text, nullptr, /*allow_exceptions=*/false);
  if (!json.is_object()) return std::nullopt;
  const auto x = numberIn(json, "x_px", -32768, 32768), y = numberIn(json, "y_px", -32768, 32768);
  const auto width = numberIn(json, "width_px", 320, 16384), height = numberIn(json, "height_px", 320, 16384);
  const auto scale = numberIn(json, "font_scale", 0.8, 2.5);
  if (!x || !y || !width || !height || !scale) return std::nullopt;
  return WindowState{static_cast<int>(*x), static_cast<int>(*y), static_cast<int>(*width),
                     static_cast<int>(*height), *scale};
}

Status writeWindowState(const std::filesystem::path& file, const WindowState& state) {
  std::error_code ignored;  // what is missing afterwards, the writing says
  if (file.has_parent_path()) std::filesystem::create_directories(file.parent_path(), ignored);
  const std::string text =
      formatted("{\"x_px\": %d, \"y_px\": %d, \"width_px\": %d, \"height_px\": %d, \"font_scale\": %.2f}\n",
                state.x_px, state.y_px, state.width_px, state.height_px, state.font_scale);
  return writeFileAtomically(file, viewOf(text));
}

}  // namespace needlelab
