/// A device's recording, or its samples as CSV (session export): input of `run` and `score`. Runs the engine
/// again along it, and compares its forces with the recorded ones.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "common/gesture/sample.h"
#include "common/gesture/whole_recording.h"
#include "common/haptics/body/given_paths.h"
#include "common/haptics/engine.h"

namespace needlelab {

struct RecordedGesture {
  std::vector<GestureSample> samples;  ///< at least one; ticks and times ascend
  std::vector<std::string> holes;      ///< in a damaged one; empty if complete
  std::string note;                    ///< for people, what was restored in a CSV; empty: nothing
  double rate_hz = 0;                  ///< as given in the file
  std::vector<Bytes> paths;            ///< of a recording: lists of paths in a body (pathsIn)
};

/// The rate comes from the metadata, otherwise from ticks and times. `rate_hz`: the rate that the caller
/// expects; empty: any. Errors: those of readRecording and readSampleCsv; kInvalidInput, with the row, for
/// ticks or times that do not ascend, for a way that looks like another unit (a CSV), for a rate other than
/// `rate_hz`, and if the file gives none; kCorrupt for missing ticks in a CSV (more than three of the usual
/// steps, and 0.1 s), unless `damaged` is kRead.
Result<RecordedGesture> readRecordedGesture(const std::filesystem::path& path, DamagedRecording damaged,
                                            WallColumns wall, std::optional<double> rate_hz);

/// Larger differences between a run's force and the recorded one count, in N: what a hand notices.
inline constexpr double kDiffers_N = 0.02;

/// |force of the run − recorded force|, over the ticks in tissue (in the run or the recording) in which the
/// gate did not change the force.
struct RecordedDifference {
  std::size_t compared_ticks = 0;
  std::size_t differing_ticks = 0;                 ///< of these, above kDiffers_N
  std::size_t gate_ticks = 0;                      ///< not compared because the gate changed the force
  double median_N = 0, p99_N = 0, greatest_N = 0;  ///< 0 if nothing was compared
};

/// Sentences for people, each with a newline.
std::string differenceText(const RecordedDifference& difference);

/// Steps the engine along recorded samples. Each second of samples starts from the recorded state
/// (`stepAsStored`: wall, phase, layer, ruptures); within it the engine runs on its own, on rounded poses, in
/// a body on the station's paths. Ticks that the station did not step are not stepped.
class RecordedRun {
 public:
  /// `model` must outlive the run.
  explicit RecordedRun(const SceneModel& model);

  /// Takes the station's paths in a body: the recording's lists, before their samples. Without them the
  /// engine finds its own.
  void takePaths(const std::vector<Bytes>& lists) { lists_.insert(lists_.end(), lists.begin(), lists.end()); }

  /// Steps the next sample. Returns the engine's own report; for a tick that is not stepped, the last one
  /// with its flag.
  const StepReport& step(const GestureSample& sample);
  /// Over all samples so far.
  [[nodiscard]] RecordedDifference difference() const;

 private:
  std::uint64_t chunk_ticks_, ticks_ = 0;
  SceneEngine told_, own_;   // set from the samples; on its own since the start of this second
  std::deque<Bytes> lists_;  // of paths, for samples to come
  GivenPaths told_paths_, own_paths_;
  StepReport report_;
  std::size_t gate_ticks_ = 0;
  std::vector<double> differences_N_;
};

}  // namespace needlelab
