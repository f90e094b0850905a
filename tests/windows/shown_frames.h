/// What a trainee's window has drawn, read from its --frame-log: tests wait for a frame, not for time.
#pragma once

#include <chrono>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <optional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "common/haptics/geometry.h"
#include "tests/integration/process.h"

namespace needlelab::test {

struct SeenFrame {
  std::uint64_t frame = 0;
  std::string screen, question;
  bool can_begin = false;
  std::uint64_t lesson = 0;
  double lesson_s = 0, depth_m = 0, plunger = 0;
  Vec3 p_WT_m, aim_WT_m;

  /// How far the tip is from where mouse and keys want it.
  [[nodiscard]] double behind_m() const { return norm(aim_WT_m - p_WT_m); }
};

class ShownFrames {
 public:
  /// `ended`: whether the program has ended, so that no frame comes any more.
  ShownFrames(std::filesystem::path file, std::function<bool()> ended)
      : file_(std::move(file)), ended_(std::move(ended)) {}

  /// The newest frame; nothing before the first.
  [[nodiscard]] std::optional<SeenFrame> newest() const {
    std::ifstream file(file_);
    std::stringstream text;
    text << file.rdbuf();
    const std::string all = text.str();
    // a line that is being written has no end yet
    const std::size_t end = all.rfind('\n');
    if (end == std::string::npos || end == 0) return std::nullopt;
    const std::size_t before = all.rfind('\n', end - 1);
    if (before == std::string::npos) return std::nullopt;  // the names of the columns
    return parsed(all.substr(before + 1, end - before - 1));
  }
  /// Waits until a frame shows what `holds` asks for; false when none has come.
  bool until(const std::function<bool(const SeenFrame&)>& holds) const {
    bool found = false;
    eventually(
        [&] {
          const auto frame = newest();
          found = frame && holds(*frame);
          return found || ended_();
        },
        std::chrono::seconds(60));
    return found;
  }
  bool untilScreen(const std::string& screen) const {
    return until([&](const SeenFrame& frame) { return frame.screen == screen; });
  }
  bool untilQuestion(const std::string& question) const {
    return until([&](const SeenFrame& frame) { return frame.question == question; });
  }
  /// Waits until a frame was drawn that saw all earlier input: the next one may have begun already.
  [[nodiscard]] bool sawInput() const {
    const auto now = newest();
    const std::uint64_t seen = (now ? now->frame : 0) + 2;
    return until([&](const SeenFrame& frame) { return frame.frame >= seen; });
  }

 private:
  static std::optional<SeenFrame> parsed(const std::string& line) {
    std::vector<std::string> cells;
    std::istringstream text(line);
    for (std::string cell; std::getline(text, cell, ',');) cells.push_back(cell);
    if (cells.size() != 15) return std::nullopt;
    const auto number = [&](std::size_t i) { return std::strtod(cells[i].c_str(), nullptr); };
    SeenFrame seen;
    seen.frame = std::strtoull(cells[0].c_str(), nullptr, 10);
    seen.screen = cells[2];
    seen.question = cells[3];
    seen.can_begin = cells[4] == "1";
    seen.lesson = std::strtoull(cells[5].c_str(), nullptr, 10);
    seen.lesson_s = number(6);
    seen.depth_m = number(7);
    seen.plunger = number(8);
    seen.p_WT_m = {number(9), number(10), number(11)};
    seen.aim_WT_m = {number(12), number(13), number(14)};
    return seen;
  }

  std::filesystem::path file_;
  std::function<bool()> ended_;
};

}  // namespace needlelab::test
