#include "client/sim/accuracy/recorded_pictures.h"

#include <algorithm>
#include <array>

#include "client/sim/accuracy/recorded_data.h"
#include "client/sim/tools/figure_table.h"
#include "client/sim/tools/gnuplot.h"
#include "common/base/csv.h"
#include "common/base/files.h"

namespace needlelab {
namespace {

std::size_t shortest(const std::vector<const std::vector<double>*>& columns) {
  std::size_t rows = columns.empty() ? 0 : columns.front()->size();
  for (const auto* column : columns) rows = std::min(rows, column->size());
  return rows;
}

void appendRows(const std::vector<const std::vector<double>*>& columns, std::string& out) {
  char cell[40];
  for (std::size_t i = 0; i < shortest(columns); ++i) {
    for (std::size_t k = 0; k < columns.size(); ++k) {
      std::snprintf(cell, sizeof cell, "%s%.9g", k > 0 ? "," : "", (*columns[k])[i]);
      out += cell;
    }
    out += '\n';
  }
}

}  // namespace

std::string safeColour(std::size_t i) {
  constexpr std::array<const char*, 7> kColours = {"#0072b2", "#d55e00", "#009e73", "#cc79a7",
                                                   "#e69f00", "#56b4e9", "#20262c"};
  return kColours[i % kColours.size()];
}

std::string dataBlock(const std::string& name, const std::vector<std::vector<double>>& columns) {
  std::vector<const std::vector<double>*> each;
  for (const auto& column : columns) each.push_back(&column);
  std::string out = "$" + name + " << EOD\n";
  appendRows(each, out);
  return out + "EOD\n";
}

std::string csvOf(const std::vector<std::pair<std::string, std::vector<double>>>& columns) {
  std::string out;
  std::vector<const std::vector<double>*> each;
  for (const auto& [name, values] : columns) {
    out += (out.empty() ? "" : ",") + name;
    each.push_back(&values);
  }
  out += '\n';
  appendRows(each, out);
  return out;
}

std::string shadedSpans(const std::vector<std::pair<double, double>>& spans, int first,
                        const std::string& colour) {
  std::string script;
  for (const auto& [from, to] : spans)
    script += "set object " + std::to_string(first++) + " rectangle from first " + fixed(from, 5) +
              ", graph 0 to first " + fixed(to, 5) + ", graph 1 behind fc rgb '" + colour +
              "' fs solid noborder\n";
  return script;
}

Result<std::vector<RecordedPicture>> recordedPictures(const AccuracyOptions& options,
                                                      const AccuracyProgress& progress) {
  using Draw = Result<RecordedPicture> (*)(const AccuracyOptions&);
  struct Part {
    const char* recording;  // empty: needs none
    Draw draw;
  };
  constexpr std::array<Part, 6> kParts = {{{kLiverHeartFile, recordedCurvePicture},
                                           {kLiverHeartFile, recordedModelsPicture},
                                           {kHoldFile, recordedHoldPicture},
                                           {kFilmFile, recordedFilmPicture},
                                           {"", [](const AccuracyOptions&) { return statisticalPicture(); }},
                                           {"", [](const AccuracyOptions&) { return epiduralPicture(); }}}};
  std::vector<RecordedPicture> pictures;
  for (std::size_t i = 0; i < kParts.size(); ++i) {
    if (*kParts[i].recording != '\0' && !hasRecording(options.data, kParts[i].recording)) continue;
    if (progress)
      progress("pictures of recorded forces", static_cast<double>(i) / static_cast<double>(kParts.size()));
    auto picture = kParts[i].draw(options);
    if (!picture.ok()) return picture.error();
    pictures.push_back(std::move(picture).value());
  }
  return pictures;
}

Status drawRecordedPictures(const std::vector<RecordedPicture>& pictures,
                            const std::filesystem::path& folder) {
  for (const RecordedPicture& picture : pictures) {
    if (Status status = writeFileAtomically(folder / (picture.name + ".csv"), viewOf(picture.csv));
        !status.ok())
      return status;
    if (!hasGnuplot()) continue;
    if (Status status =
            plotPng(picture.script, folder / (picture.name + ".png"), picture.width_px, picture.height_px);
        !status.ok())
      return status;
  }
  return {};
}

}  // namespace needlelab
