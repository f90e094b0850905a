/// Draws pictures with gnuplot, found at run time, from plot files and their tables.
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

/// A variable of a plot file and its name: a number, a text, or an array of numbers or texts.
using PlotVariable =
    std::pair<std::string, std::variant<double, std::string, std::vector<double>, std::vector<std::string>>>;

/// Draws `png` with the plot file `plot` of client/sim/plots ("fig07"). The picture appears only when
/// complete; the plot file gets its path as `png`, in addition to `variables`. Errors: kFailed with gnuplot's
/// own message, kNotFound for an unknown plot file.
Status drawPlot(std::string_view plot, const std::filesystem::path& png,
                const std::vector<PlotVariable>& variables);

/// The same with a plot file from `files`, which may load the others.
Status drawPlot(std::span<const EmbeddedFile> files, std::string_view plot, const std::filesystem::path& png,
                const std::vector<PlotVariable>& variables);

/// A CSV under construction. Numbers have 9 significant digits: enough for a picture.
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

/// A picture's data in blocks. A plot file finds a block by `index 'name;'` (gnuplot compares prefixes, so a
/// name must end in a mark). Tab-separated, so texts may contain commas.
class PlotBlocks {
 public:
  /// Adds a row to a block: the numbers, then the texts.
  void row(std::string_view block, std::initializer_list<double> numbers,
           std::initializer_list<std::string_view> texts = {});
  /// All blocks, in the order of their first rows.
  [[nodiscard]] std::string text() const;

 private:
  std::string& rowsOf(std::string_view block);
  std::vector<std::pair<std::string, std::string>> blocks_;  // name, rows
};

}  // namespace needlelab
