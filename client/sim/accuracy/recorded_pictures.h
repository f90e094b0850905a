/// Pictures of the models beside recorded needle forces, for `needlelab-sim accuracy --out`.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "client/sim/accuracy/study.h"

namespace needlelab {

/// A table, and the gnuplot script that draws it (all numbers that it needs are in the script).
struct RecordedPicture {
  std::string name;  ///< file name without ending, e.g. "recorded_curve"
  std::string csv;
  std::string script;
  int width_px = 1400, height_px = 900;
};

/// Of those recordings that are there, and of what needs none. Fits anew (about 2 s). Errors: as of the
/// parts that give the rows.
Result<std::vector<RecordedPicture>> recordedPictures(const AccuracyOptions& options,
                                                      const AccuracyProgress& progress);

/// Writes `name.csv` of each picture into `folder`, which exists, and draws `name.png` where gnuplot is on
/// the PATH. Errors: a file that cannot be written; those of `plotPng`.
Status drawRecordedPictures(const std::vector<RecordedPicture>& pictures,
                            const std::filesystem::path& folder);

// the parts
Result<RecordedPicture> recordedCurvePicture(const AccuracyOptions& options);  ///< three models and their gap
Result<RecordedPicture> recordedModelsPicture(const AccuracyOptions& options);  ///< every model, a panel each
Result<RecordedPicture> recordedHoldPicture(const AccuracyOptions& options);
Result<RecordedPicture> recordedFilmPicture(const AccuracyOptions& options);
Result<RecordedPicture> statisticalPicture();
Result<RecordedPicture> epiduralPicture();

/// gnuplot's name for a colour that people with colour-blindness tell apart (Okabe and Ito 2008), 0 to 6:
/// blue, vermilion, green, purple, orange, sky, black.
std::string safeColour(std::size_t i);

/// Columns as a data block `$name` of a script, comma-separated; columns of unequal length end with the
/// shortest.
std::string dataBlock(const std::string& name, const std::vector<std::vector<double>>& columns);
/// The same as a CSV with a header.
std::string csvOf(const std::vector<std::pair<std::string, std::vector<double>>>& columns);
/// Rectangles behind a plot over its whole height, from object `first` on; `spans` in the x axis' unit.
std::string shadedSpans(const std::vector<std::pair<double, double>>& spans, int first,
                        const std::string& colour);

}  // namespace needlelab
