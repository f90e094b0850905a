#include "client/sim/accuracy/recorded.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>

#include "client/sim/accuracy/recorded_data.h"
#include "client/sim/tools/gnuplot.h"
#include "common/base/files.h"

namespace needlelab {

Result<AccuracyRows> recordedRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                                  std::vector<std::string>& notes) {
  AccuracyRows all;
  for (const auto part :
       {recordedCurveRows, recordedHoldRows, recordedFilmRows, statisticalRows, epiduralRows}) {
    ASSIGN_OR_RETURN(auto rows, part(options, progress, notes));
    all.insert(all.end(), rows.begin(), rows.end());
  }
  return all;
}

std::string csvOf(const std::vector<std::pair<std::string, std::vector<double>>>& columns) {
  std::string out;
  std::size_t rows = columns.empty() ? 0 : columns.front().second.size();
  for (const auto& [name, values] : columns) {
    out += (out.empty() ? "" : ",") + name;
    rows = std::min(rows, values.size());
  }
  out += '\n';
  for (std::size_t i = 0; i < rows; ++i) {
    for (std::size_t k = 0; k < columns.size(); ++k)
      out += fmt::format("{}{:.9g}", k > 0 ? "," : "", columns[k].second[i]);
    out += '\n';
  }
  return out;
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
    ASSIGN_OR_RETURN(auto picture, kParts[i].draw(options));
    pictures.push_back(std::move(picture));
  }
  return pictures;
}

Status drawRecordedPictures(const std::vector<RecordedPicture>& pictures,
                            const std::filesystem::path& folder) {
  for (const RecordedPicture& picture : pictures) {
    RETURN_IF_ERROR(writeFileAtomically(folder / (picture.name + ".csv"), viewOf(picture.csv)));
    if (!hasGnuplot()) continue;
    const auto data = folder / (picture.name + ".dat");
    RETURN_IF_ERROR(writeFileAtomically(data, viewOf(picture.data)));
    auto variables = picture.variables;
    variables.emplace_back("data", data.string());
    RETURN_IF_ERROR(drawPlot(picture.name, folder / (picture.name + ".png"), variables));
  }
  return {};
}

}  // namespace needlelab
