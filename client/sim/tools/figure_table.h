/// What the figures share: tables, the stretches of time of a phase, and the look of the pictures.
#pragma once

#include <initializer_list>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "client/sim/tools/figures.h"

namespace needlelab {

/// A CSV under construction. Numbers have 9 significant digits: a picture's data, not a recording.
class FigureTable {
 public:
  explicit FigureTable(std::string_view header) : text_(std::string(header) + "\n") {}
  /// One row: the numbers, then the words.
  void row(std::initializer_list<double> numbers, std::initializer_list<std::string_view> words = {}) {
    row(std::span(numbers.begin(), numbers.size()), words);
  }
  void row(std::span<const double> numbers, std::initializer_list<std::string_view> words = {});
  [[nodiscard]] std::string take() { return std::move(text_); }

 private:
  std::string text_;
};

/// A stretch of ticks with the same phase.
struct PhaseSpan {
  Phase phase = Phase::kFree;
  double from_s = 0, to_s = 0;
};
/// In order, without gaps. Stretches shorter than `least_s` go to their neighbour before.
std::vector<PhaseSpan> phaseSpans(const FigureRun& run, double least_s);

/// Fonts, line styles 1-6, border and grid. Line 1 is the needle (blue), 2 the wall (orange), 3 cutting
/// (red), 4 attracted (green), 5 clamping (pink), 6 thin grey.
std::string figureStyle();

/// gnuplot commands that shade the phases over the whole height of the plot that follows, from object number
/// `first` on.
std::string phaseShades(const std::vector<PhaseSpan>& spans, int first);
/// The same phases' names at the top of the plot that follows, whose time axis goes from `from_s` to `to_s`;
/// a name that has not enough room is left out.
std::string phaseNames(const std::vector<PhaseSpan>& spans, double from_s, double to_s);

/// `number` with `digits` after the point, for a script.
std::string fixed(double number, int digits);
/// A path or text in gnuplot's single quotes.
std::string quoted(const std::string& text);

}  // namespace needlelab
