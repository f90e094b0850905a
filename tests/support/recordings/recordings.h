/// Recordings that tests play and fit. The real ones, a Virtuose's poses and published needle forces, are not
/// in the repository, because their licences do not allow that. Tests that want recordings therefore also run
/// on ones that we make; these are marked as such and prove nothing about real hands or tissue.
#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <vector>

namespace needlelab::test {

/// A folder with virtuose/*.csv and needle_force/*.csv.
struct Recordings {
  std::filesystem::path folder;
  bool real = false;  ///< false: made by us
  [[nodiscard]] std::string name() const { return real ? "real" : "made"; }
};

/// The names of the pose recordings: virtuose/NAME.csv.
inline constexpr std::array<const char*, 4> kPoseRecordings = {"backward", "downward", "lateral_left",
                                                               "virtuose_x_backward"};

/// Where real recordings are looked for: the variable NEEDLELAB_DATA, otherwise ../shared/data beside the
/// repository. May not exist.
std::filesystem::path realRecordingsFolder();

/// The recordings that we make, written to a temporary folder at the first call and removed when the process
/// ends. The same bits on every machine. Poses: a simulated hand with tremor moves the simulated Virtuose
/// along four strokes, 1 kHz, encoder steps, jittered times of receipt. Forces: curves by formula with the
/// figures that are published about the real ones, and noise.
const Recordings& madeRecordings();

/// The made ones, and the real ones if they are present: for tests that are quick enough to run on both.
std::vector<Recordings> allRecordings();

/// The real ones if they are present, otherwise the made ones.
Recordings preferredRecordings();

}  // namespace needlelab::test
