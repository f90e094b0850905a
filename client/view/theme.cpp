#include "client/view/theme.h"

#include <epoxy/gl.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <string>

#include <imgui/imgui.h>

#include "client/view/gl_objects.h"

namespace needlelab {
namespace {

constexpr const char* kFontFolder = "/usr/share/fonts/truetype/dejavu/";

// European letters for names of people and tissues, and all signs used in the windows
constexpr ImWchar kTextRanges[] = {0x0020, 0x024F, 0x0370, 0x03FF, 0x0400, 0x045F, 0x2010, 0x2027, 0x2030,
                                   0x205E, 0x2070, 0x209C, 0x20AC, 0x20AC, 0x2190, 0x21FF, 0x2200, 0x22FF,
                                   0x23E9, 0x23FA, 0x25A0, 0x25FF, 0x2600, 0x26FF, 0x2700, 0x27BF, 0};
// the largest font only needs digits and units
constexpr ImWchar kFigureRanges[] = {0x0020, 0x00FF, 0x03B1, 0x03C9, 0x2010, 0x2026, 0x2190,
                                     0x2193, 0x2212, 0x2212, 0x221E, 0x221E, 0x25A0, 0x25CF,
                                     0x26A0, 0x26A0, 0x2713, 0x2718, 0};

void addFont(const char* file, float size_px, const ImWchar* ranges) {
  ImFontAtlas& atlas = *ImGui::GetIO().Fonts;
  ImFontConfig config;
  // an oversampling of 1 is enough for letters of this size, and halves the atlas
  config.OversampleH = size_px > 30 ? 1 : 2;
  config.OversampleV = 1;
  config.PixelSnapH = true;
  const std::filesystem::path path = std::filesystem::path(kFontFolder) / file;
  std::error_code ignored;
  if (!std::filesystem::exists(path, ignored) ||
      atlas.AddFontFromFileTTF(path.c_str(), size_px, &config, ranges) == nullptr) {
    ImFontConfig own;
    own.SizePixels = size_px;
    atlas.AddFontDefault(&own);
  }
}

}  // namespace

void loadFonts(const LetterSizes& sizes) {
  ImFontAtlas& atlas = *ImGui::GetIO().Fonts;
  atlas.Clear();
  atlas.Flags |= ImFontAtlasFlags_NoPowerOfTwoHeight;
  atlas.TexDesiredWidth = 4096;
  addFont("DejaVuSans.ttf", static_cast<float>(sizes.body_px), kTextRanges);
  addFont("DejaVuSans.ttf", static_cast<float>(sizes.small_px), kTextRanges);
  addFont("DejaVuSans-Bold.ttf", static_cast<float>(sizes.heading_px), kTextRanges);
  addFont("DejaVuSans-Bold.ttf", static_cast<float>(sizes.figure_px), kFigureRanges);
}

ImFont* fontOf(Letters letters) {
  ImVector<ImFont*>& fonts = ImGui::GetIO().Fonts->Fonts;
  const int index = static_cast<int>(letters);
  return index < fonts.Size ? fonts[index] : ImGui::GetFont();
}

namespace {

constexpr Rgb kFieldGrey = rgbOf(0x2A303A), kFieldHover = rgbOf(0x38404D), kFieldActive = rgbOf(0x465164);
constexpr Rgb kAccent = kSkyBlue;

void writeText(std::string_view text) {
  ImGui::TextUnformatted(text.data(), text.data() + text.size());
}

ImVec2 sizeOf(std::string_view text) {
  return ImGui::CalcTextSize(text.data(), text.data() + text.size());
}

// Returns the number of UTF-8 bytes that fit into the width.
std::size_t bytesThatFit(std::string_view text, float width_px) {
  const char* rest = nullptr;
  ImFont* font = ImGui::GetFont();
  font->CalcTextSizeA(ImGui::GetFontSize(), width_px, 0, text.data(), text.data() + text.size(), &rest);
  return rest == nullptr ? 0 : static_cast<std::size_t>(rest - text.data());
}

}  // namespace

void applyTheme(const LetterSizes& sizes) {
  ImGuiStyle style;
  ImGui::StyleColorsDark(&style);
  const auto scale = static_cast<float>(sizes.body_px / LetterSizes().body_px);
  style.WindowPadding = {12, 10};
  style.FramePadding = {10, 6};
  style.ItemSpacing = {9, 7};
  style.ItemInnerSpacing = {7, 5};
  style.CellPadding = {8, 5};
  style.ScrollbarSize = 16;
  style.GrabMinSize = 14;
  style.WindowRounding = 0;
  style.ChildRounding = 3;
  style.FrameRounding = 5;
  style.PopupRounding = 6;
  style.GrabRounding = 5;
  style.TabRounding = 5;
  style.ScrollbarRounding = 6;
  style.WindowBorderSize = 0;
  style.ChildBorderSize = 1;
  style.FrameBorderSize = 0;
  style.AntiAliasedLinesUseTex = true;
  style.ScaleAllSizes(scale);
  ImVec4* colours = style.Colors;
  const auto set = [&](ImGuiCol which, Rgb colour, float opacity = 1) {
    colours[which] = colourOf(colour, opacity);
  };
  set(ImGuiCol_Text, kText);
  set(ImGuiCol_TextDisabled, kDimText);
  set(ImGuiCol_WindowBg, kWindowGrey);
  set(ImGuiCol_ChildBg, kPanelGrey);
  set(ImGuiCol_PopupBg, rgbOf(0x252B34), 0.98F);
  set(ImGuiCol_Border, kLineGrey);
  set(ImGuiCol_FrameBg, kFieldGrey);
  set(ImGuiCol_FrameBgHovered, kFieldHover);
  set(ImGuiCol_FrameBgActive, kFieldActive);
  set(ImGuiCol_Button, kFieldGrey);
  set(ImGuiCol_ButtonHovered, kFieldHover);
  set(ImGuiCol_ButtonActive, kFieldActive);
  set(ImGuiCol_Header, kAccent, 0.24F);
  set(ImGuiCol_HeaderHovered, kAccent, 0.34F);
  set(ImGuiCol_HeaderActive, kAccent, 0.46F);
  set(ImGuiCol_CheckMark, kAccent);
  set(ImGuiCol_SliderGrab, kAccent, 0.85F);
  set(ImGuiCol_SliderGrabActive, kAccent);
  set(ImGuiCol_Separator, kLineGrey);
  set(ImGuiCol_ScrollbarBg, kWindowGrey, 0);
  set(ImGuiCol_ScrollbarGrab, kLineGrey);
  set(ImGuiCol_Tab, kFieldGrey);
  set(ImGuiCol_TabHovered, kAccent, 0.5F);
  set(ImGuiCol_TabActive, mixed(kPanelGrey, kAccent, 0.42F));
  set(ImGuiCol_PlotHistogram, kAccent);
  set(ImGuiCol_TableHeaderBg, kFieldGrey);
  set(ImGuiCol_TableBorderLight, kLineGrey);
  set(ImGuiCol_TableBorderStrong, kLineGrey);
  set(ImGuiCol_TableRowBgAlt, kWhite, 0.03F);
  set(ImGuiCol_NavHighlight, kYellow);
  set(ImGuiCol_TextSelectedBg, kAccent, 0.4F);
  set(ImGuiCol_ModalWindowDimBg, kBlack, 0.6F);
  ImGui::GetStyle() = style;
}

float space() {
  return fontOf(Letters::kBody)->FontSize * 0.5F;
}

std::string fittedText(std::string_view text, float width_px) {
  if (sizeOf(text).x <= width_px) return std::string(text);
  return std::string(text.substr(0, bytesThatFit(text, width_px - sizeOf("…").x))) + "…";
}

void textLine(std::string_view text, float width_px) {
  if (width_px <= 0) width_px = ImGui::GetContentRegionAvail().x;
  if (sizeOf(text).x <= width_px) {
    writeText(text);
    return;
  }
  writeText(fittedText(text, width_px));
  if (ImGui::IsItemHovered()) {
    ImGui::BeginTooltip();
    ImGui::PushTextWrapPos(30 * ImGui::GetFontSize());
    writeText(text);
    ImGui::PopTextWrapPos();
    ImGui::EndTooltip();
  }
}

void textBlock(std::string_view text) {
  ImGui::PushTextWrapPos(0);
  writeText(text);
  ImGui::PopTextWrapPos();
}

void conditionLine(Condition condition, std::string_view words) {
  const ConditionStyle& style = styleOf(condition);
  {
    WithTextColour colour(style.colour);
    writeText(style.sign);
  }
  ImGui::SameLine(0, space() * 0.7F);
  ImGui::BeginGroup();
  WithTextColour colour(condition == Condition::kGood || condition == Condition::kUnknown ? kText
                                                                                          : style.colour);
  textBlock(words);
  ImGui::EndGroup();
}

void figure(std::string_view value, std::string_view unit, std::string_view caption, Rgb colour) {
  // Draws directly, without layout: three letter sizes, each on its own line.
  const ImVec2 at = ImGui::GetCursorScreenPos();
  ImDrawList& list = *ImGui::GetWindowDrawList();
  ImVec2 size{0, 0};
  {
    WithFont font(Letters::kFigure);
    list.AddText(at, packed(colour), value.data(), value.data() + value.size());
    size = sizeOf(value);
  }
  if (!unit.empty()) {
    WithFont font(Letters::kHeading);
    const ImVec2 unit_size = sizeOf(unit);
    list.AddText({at.x + size.x + space() * 0.6F, at.y + (size.y - unit_size.y) * 0.80F}, packed(kDimText),
                 unit.data(), unit.data() + unit.size());
    size.x += space() * 0.6F + unit_size.x;
  }
  if (!caption.empty()) {
    WithFont font(Letters::kSmall);
    const ImVec2 caption_size = sizeOf(caption);
    list.AddText({at.x, at.y + size.y * 0.96F}, packed(kDimText), caption.data(),
                 caption.data() + caption.size());
    size = {std::max(size.x, caption_size.x), size.y * 0.96F + caption_size.y};
  }
  ImGui::Dummy(size);
}

void keyHint(std::string_view key, std::string_view meaning) {
  const ImVec2 size = sizeOf(key);
  const float pad = space() * 0.5F;
  const ImVec2 at = ImGui::GetCursorScreenPos();
  ImDrawList& list = *ImGui::GetWindowDrawList();
  const ImVec2 end{at.x + size.x + 2 * pad, at.y + size.y + 2};
  list.AddRectFilled(at, end, packed(kFieldGrey), 4);
  list.AddRect(at, end, packed(kLineGrey), 4);
  list.AddText({at.x + pad, at.y + 1}, packed(kText), key.data(), key.data() + key.size());
  ImGui::Dummy({size.x + 2 * pad, size.y + 2});
  ImGui::SameLine(0, space() * 0.6F);
  WithTextColour colour(kDimText);
  writeText(meaning);
}

bool bigButton(const char* label, bool primary, float width_px, bool enabled) {
  const float height_px = fontOf(Letters::kBody)->FontSize * 2.3F;
  ImGui::BeginDisabled(!enabled);
  if (primary) {
    ImGui::PushStyleColor(ImGuiCol_Button, colourOf(kBlue));
    ImGui::PushStyleColor(ImGuiCol_ButtonHovered, colourOf(mixed(kBlue, kSkyBlue, 0.35F)));
    ImGui::PushStyleColor(ImGuiCol_ButtonActive, colourOf(mixed(kBlue, kSkyBlue, 0.6F)));
  }
  const bool pressed = ImGui::Button(label, {width_px, height_px});
  if (primary) ImGui::PopStyleColor(3);
  ImGui::EndDisabled();
  return pressed;
}

void levelBar(double share, std::string_view text, Rgb colour, float width_px) {
  if (width_px <= 0) width_px = ImGui::GetContentRegionAvail().x;
  const float height_px = ImGui::GetFontSize() * 1.35F;
  const ImVec2 at = ImGui::GetCursorScreenPos();
  ImDrawList& list = *ImGui::GetWindowDrawList();
  const ImVec2 end{at.x + width_px, at.y + height_px};
  const bool over = share > 1;
  const ConditionStyle& trouble = styleOf(Condition::kTrouble);
  const auto filled = static_cast<float>(std::clamp(std::isnan(share) ? 0.0 : share, 0.0, 1.0));
  list.AddRectFilled(at, end, packed(kFieldGrey), 4);
  if (filled > 0)
    list.AddRectFilled(at, {at.x + width_px * filled, end.y}, packed(over ? trouble.colour : colour, 0.8F),
                       4);
  const std::string shown = over ? std::string(trouble.sign) + " " + std::string(text) : std::string(text);
  const ImVec2 size = sizeOf(shown);
  const ImVec2 where{at.x + space() * 0.7F, at.y + (height_px - size.y) * 0.5F};
  // a dark shadow keeps the text legible on any colour
  list.AddText({where.x + 1, where.y + 1}, packed(kBlack, 0.85F), shown.c_str());
  list.AddText(where, packed(kWhite), shown.c_str());
  ImGui::Dummy({width_px, height_px});
}

void beginScreen(const char* id) {
  ImGui::SetNextWindowPos({0, 0});
  ImGui::SetNextWindowSize(ImGui::GetIO().DisplaySize);
  ImGui::Begin(id, nullptr,
               ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoSavedSettings |
                   ImGuiWindowFlags_NoBringToFrontOnFocus |
                   ImGuiWindowFlags_NoBackground);  // the surface is cleared in that colour
}

void endScreen() {
  ImGui::End();
}

void beginPanel(const char* id, std::string_view heading, float width_px, float height_px) {
  ImGui::PushStyleColor(ImGuiCol_ChildBg, colourOf(kPanelGrey, 0));
  ImGui::BeginChild(id, {width_px, height_px}, true, ImGuiWindowFlags_AlwaysUseWindowPadding);
  ImGui::PopStyleColor();
  // inside its frame line
  const ImVec2 at = ImGui::GetWindowPos(), size = ImGui::GetWindowSize();
  ImGui::PushClipRect({at.x + 1, at.y + 1}, {at.x + size.x - 1, at.y + size.y - 1}, false);
  solidRect(*ImGui::GetWindowDrawList(), at, {at.x + size.x, at.y + size.y}, kPanelGrey);
  ImGui::PopClipRect();
  if (heading.empty()) return;
  WithFont font(Letters::kHeading);
  writeText(heading);
}

void endPanel() {
  ImGui::EndChild();
}

// Opaque rectangles without texture or blending: with llvmpipe a clear costs a tenth of ImGui's own
// rectangles.
namespace {

struct SolidJob {
  ImVec2 from_px, to_px;
  Rgb colour;
};

// Jobs of the current frame; ImGui's lists refer to them until the next frame begins.
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

void solidRect(ImDrawList& list, ImVec2 from_px, ImVec2 to_px, Rgb colour) {
  SolidJob& job = newJob();
  job = {from_px, to_px, colour};
  for (const float number : {from_px.x, from_px.y, to_px.x, to_px.y, colour.red, colour.green, colour.blue})
    noteContent(std::bit_cast<std::uint32_t>(number));
  list.AddCallback(&clearRect, &job);
}

}  // namespace needlelab
