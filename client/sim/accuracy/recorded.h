/// The accuracy report's comparison of models with recorded needle forces. A part without its recording is
/// skipped with a note.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "client/sim/accuracy/study.h"
#include "client/sim/tools/gnuplot.h"

namespace needlelab {

/// Every model that can follow it, fitted to a part of the force-depth curve of bovine liver and heart; the
/// error on the part held out: alternate blocks, and the end of the curve (extrapolation).
Result<AccuracyRows> recordedCurveRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                                       std::vector<std::string>& notes);
/// The hold's relaxation by the stop's two modes, and the withdrawal.
Result<AccuracyRows> recordedHoldRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                                      std::vector<std::string>& notes);
/// Puncture of a film: each needle predicted from the two others by a power law.
Result<AccuracyRows> recordedFilmRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                                      std::vector<std::string>& notes);
/// The statistical model's draws against their specified distribution. Needs no recording.
Result<AccuracyRows> statisticalRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                                     std::vector<std::string>& notes);
/// The epidural sample's table against the polynomials that it restates. Needs no recording.
Result<AccuracyRows> epiduralRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                                  std::vector<std::string>& notes);

/// All of them, in that order.
Result<AccuracyRows> recordedRows(const AccuracyOptions& options, const AccuracyProgress& progress,
                                  std::vector<std::string>& notes);

/// A table, and what its plot file (client/sim/plots, by the picture's name) reads.
struct RecordedPicture {
  std::string name;  ///< file name without ending, e.g. "recorded_curve"
  std::string csv;
  std::string data;                     ///< blocks; the plot file finds their path in `data`
  std::vector<PlotVariable> variables;  ///< beside `data`
};

/// One picture for each recording in the folder, and the pictures that need no recording. Repeats the fits
/// (about 2 s). Errors: as of the parts that give the rows.
Result<std::vector<RecordedPicture>> recordedPictures(const AccuracyOptions& options,
                                                      const AccuracyProgress& progress);

/// Writes `name.csv` of each picture into the existing `folder`, and also `name.dat` and `name.png` if
/// gnuplot is on the PATH. Errors: a file that cannot be written; those of `drawPlot`.
Status drawRecordedPictures(const std::vector<RecordedPicture>& pictures,
                            const std::filesystem::path& folder);

// the parts
Result<RecordedPicture> recordedCurvePicture(const AccuracyOptions& options);  ///< three models and their gap
Result<RecordedPicture> recordedModelsPicture(const AccuracyOptions& options);  ///< every model, a panel each
Result<RecordedPicture> recordedHoldPicture(const AccuracyOptions& options);
Result<RecordedPicture> recordedFilmPicture(const AccuracyOptions& options);
Result<RecordedPicture> statisticalPicture();
Result<RecordedPicture> epiduralPicture();

/// Columns as a CSV with a header; columns of unequal length end with the shortest.
std::string csvOf(const std::vector<std::pair<std::string, std::vector<double>>>& columns);

}  // namespace needlelab
