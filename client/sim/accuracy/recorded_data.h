/// Recorded needle forces to compare models with (data/README.md says where they come from). They are not
/// part of the repository: the program reads them from NEEDLELAB_DATA, or from ../shared/data.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "common/base/result.h"

namespace needlelab {

/// Axial force on the needle at a depth; positive pushes the needle out.
struct ForceAtDepth {
  double depth_m = 0, force_N = 0;
};
/// Axial force on the needle at a time.
struct ForceAtTime {
  double t_s = 0, force_N = 0;
};
/// One puncture of a test film. Samples are 5 or 10 µm apart.
struct FilmTrace {
  std::string name;    ///< "16G-1"
  std::string needle;  ///< "16G"
  std::vector<double> force_N;
};

/// NEEDLELAB_DATA, or "../shared/data" where it is not set.
std::filesystem::path recordedDataFolder();

inline constexpr const char* kLiverHeartFile = "needle_force/bovine_liver_heart_18g.csv";
inline constexpr const char* kHoldFile = "needle_force/insert_hold_withdraw.csv";
inline constexpr const char* kFilmFile = "needle_force/film_puncture.csv";

/// Returns whether `folder` has the file; otherwise a message tells the user how to provide it.
bool hasRecording(const std::filesystem::path& folder, const char* file);
std::string missingRecording(const std::filesystem::path& folder, const char* file);

/// The force-depth curve in the order of depth; rows of equal depth keep their order in the file. It was
/// digitised in several passes, so that the file itself goes back in depth: `backward_steps` counts how often
/// (null: not asked for). Errors: those of `readCsv`.
Result<std::vector<ForceAtDepth>> readForceOverDepth(const std::filesystem::path& file,
                                                     int* backward_steps = nullptr);
/// In the order of time. Errors: those of `readCsv`.
Result<std::vector<ForceAtTime>> readForceOverTime(const std::filesystem::path& file);
/// One trace per name, in the order of the file. Errors: those of `readCsv`; kInvalidInput for a trace name
/// without a needle's gauge at the start, as "16G-".
Result<std::vector<FilmTrace>> readFilmTraces(const std::filesystem::path& file);

}  // namespace needlelab
