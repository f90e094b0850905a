/// Draws pictures with gnuplot, found at run time, from plot files and the tables that they read.
#pragma once

#include <filesystem>
#include <initializer_list>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "common/base/program.h"
#include "common/base/result.h"

namespace needlelab {

/// Whether `gnuplot` is on the PATH.
bool hasGnuplot();

/// A variable of a plot file, by its name: a number, a text, or an array of numbers or texts.
using PlotVariable =
    std::pair<std::string, std::variant<double, std::string, std::vector<double>, std::vector<std::string>>>;

/// Draws `png` with the plot file `plot` of client/sim/plots ("fig07"). The picture file appears only when it
/// is complete; the plot file gets its path as `png`, besides the `variables`. Errors: kFailed with gnuplot's
/// own message, kNotFound for an unknown plot file.
Status drawPlot(std::string_view plot, const std::filesystem::path& png,
                const std::vector<PlotVariable>& variables);

/// The same with a plot file of `files`, which may load the others.
Status drawPlot(std::span<const EmbeddedFile> files, std::string_view plot, const std::filesystem::path& png,
                const std::vector<PlotVariable>& variables);

/// A CSV under construction. Numbers have 9 significant digits: a picture's data, not a recording.
class PlotTable {
 public:
  explicit PlotTable(std::string_view header) : text_(std::string(header) + "\n") {}
  /// One row: the numbers, then the texts.
  void row(std::initializer_list<double> numbers, std::initializer_list<std::string_view> texts = {}) {
    row(std::span(numbers.begin(), numbers.size()), texts);
  }
  void row(std::span<const double> numbers, std::initializer_list<std::string_view> texts = {});
  [[nodiscard]] std::string take() { return std::move(text_); }

 private:
  std::string text_;
};

/// Data of a picture in blocks. A plot file finds a block by `index 'name;'` (gnuplot compares the first
/// letters only, so a name must end in a mark). Tab-separated, so that texts may hold commas.
class PlotBlocks {
 public:
  /// Adds a row to a block: the numbers, then the texts.
  void row(std::string_view block, std::initializer_list<double> numbers,
           std::initializer_list<std::string_view> texts = {});
  /// Rows of a block by columns; columns of unequal length end with the shortest.
  void columns(std::string_view block, const std::vector<std::vector<double>>& columns);
  /// All blocks, in the order of their first rows.
  [[nodiscard]] std::string text() const;

 private:
  std::string& rowsOf(std::string_view block);
  std::vector<std::pair<std::string, std::string>> blocks_;  // name, rows
};

}  // namespace needlelab
