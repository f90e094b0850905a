/// Recordings that tests play and fit. The real ones, a Virtuose's poses and published needle forces, are not
/// in the repository, because their licences do not allow that. Tests that need recordings therefore also run
/// on generated ones; these are marked as such and prove nothing about real hands or tissue.
#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <vector>

namespace needlelab::test {

/// A folder with virtuose/*.csv and needle_force/*.csv.
struct Recordings {
  std::filesystem::path folder;
  bool real = false;  ///< false: generated
  [[nodiscard]] std::string name() const { return real ? "real" : "made"; }
};

/// The names of the pose recordings: virtuose/NAME.csv.
inline constexpr std::array<const char*, 4> kPoseRecordings = {"backward", "downward", "lateral_left",
                                                               "virtuose_x_backward"};

/// Where real recordings are searched for: the variable NEEDLELAB_DATA, otherwise ../shared/data beside the
/// repository. May not exist.
std::filesystem::path realRecordingsFolder();

/// The generated recordings, written to a temporary folder at the first call and removed when the process
/// ends. The same bits on every machine. Poses: a simulated hand with tremor moves the simulated Virtuose
/// along four strokes, 1 kHz, encoder steps, jittered receive times. Forces: curves by formula with the
/// published figures of the real ones, plus noise.
const Recordings& madeRecordings();

/// The generated ones, and the real ones if present: for tests quick enough to run on both.
std::vector<Recordings> allRecordings();

/// The real ones if present, otherwise the generated ones.
Recordings preferredRecordings();

}  // namespace needlelab::test
