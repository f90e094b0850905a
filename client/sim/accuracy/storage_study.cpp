#include "client/sim/accuracy/study.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <span>
#include <utility>

#include "client/sim/accuracy/gesture.h"
#include "client/sim/accuracy/panel_layout.h"
#include "client/sim/accuracy/row.h"
#include "common/base/clock.h"
#include "common/gesture/chunk.h"

namespace needlelab {
namespace {

constexpr std::array<double, 8> kQuanta_m = {0, 0.1e-6, 0.3e-6, 1e-6, 3e-6, 10e-6, 30e-6, 100e-6};
constexpr std::size_t kChunk = 1000;  // a second, as the station makes them

struct Stored {
  std::vector<GestureSample> samples;
  double bytes_per_sample = 0;
  Timing encode, decode;  // of a sample, of the last run
  CostInterval both_ns;   // of a sample: the runs' medians
};

Timing perSample(Timing timing, std::size_t samples) {
  const auto n = static_cast<double>(samples);
  timing.median_ns /= n, timing.p99_ns /= n, timing.least_ns /= n, timing.resolution_ns /= n;
  timing.per_batch *= samples;
  return timing;
}

Result<Stored> throughCodec(const std::vector<GestureSample>& samples, const Resolution& resolution,
                            double budget_s) {
  Stored stored;
  std::vector<std::span<const GestureSample>> parts;
  std::vector<Bytes> chunks;
  std::size_t bytes = 0;
  for (std::size_t at = 0; at < samples.size(); at += kChunk) {
    const auto part = std::span(samples).subspan(at, std::min(kChunk, samples.size() - at));
    Bytes chunk = encodeChunk(resolution, part);
    bytes += chunk.size();
    ASSIGN_OR_RETURN(auto back, decodeChunk(chunk));
    stored.samples.insert(stored.samples.end(), back.begin(), back.end());
    if (part.size() < kChunk) continue;  // whole ones only are timed
    parts.push_back(part);
    chunks.push_back(std::move(chunk));
  }
  stored.bytes_per_sample = static_cast<double>(bytes) / static_cast<double>(samples.size());
  if (parts.empty()) return Error{ErrorCode::kFailed, "a lesson of less than a second cannot be timed"};
  constexpr int kRuns = 5;
  std::size_t next = 0;
  std::vector<double> runs_ns;
  for (int run = 0; run < kRuns; ++run) {
    stored.encode =
        perSample(timeFor(budget_s / kRuns,
                          [&] { keep(encodeChunk(resolution, parts[next++ % parts.size()]).data()); }),
                  kChunk);
    stored.decode = perSample(
        timeFor(budget_s / kRuns, [&] { keep(decodeChunk(chunks[next++ % chunks.size()])->data()); }),
        kChunk);
    runs_ns.push_back(stored.encode.median_ns + stored.decode.median_ns);
  }
  stored.both_ns = intervalOf(std::move(runs_ns));
  return stored;
}

AccuracyRow rowOf(const StudyLesson& lesson, double quantum_m, const Stored& stored) {
  AccuracyRow row;
  row.study = AccuracyStudy::kStorage;
  row.scene = lesson.name;
  row.rate_hz = lesson.model.rate_hz;
  row.quantum_m = quantum_m;
  row.bytes_per_sample = stored.bytes_per_sample;
  row.bytes_per_s = stored.bytes_per_sample * lesson.model.rate_hz;
  row.runs_ns = stored.both_ns;
  row.median_ns = stored.both_ns.value;
  row.p99_ns = stored.encode.p99_ns + stored.decode.p99_ns;
  row.cpu_share = *row.median_ns * lesson.model.rate_hz * 1e-9;
  row.fits_rate = *row.p99_ns <= 1e9 / lesson.model.rate_hz;
  const std::string text = fmt::format("force {}; encode {:.0f} ns, decode {:.0f} ns a sample",
                                       newtonText(scaledResolution(quantum_m).force_N, 3),
                                       stored.encode.median_ns, stored.decode.median_ns);
  row.variant = quantum_m > 0 ? text : "lossless; " + text.substr(text.find(';') + 2);
  ErrorSum position;
  ErrorSum force;
  for (std::size_t i = 0; i < stored.samples.size(); ++i) {
    const GestureSample &was = lesson.samples[i], &is = stored.samples[i];
    for (int k = 0; k < 3; ++k) position.add(is.p_WT_m[k] - was.p_WT_m[k]);
    if (was.layer >= 0) force.add(std::hypot(was.force_W_N[0], was.force_W_N[1], was.force_W_N[2]));
  }
  row.rms_error_m = position.rms();
  row.noticeable_n = noticeableForce_N(force.rms());
  return row;
}

// the error of each second is a repeat
void setErrors(AccuracyRow& row, const StudyLesson& lesson, const std::vector<Vec3>& forces_N,
               const Stored& stored) {
  ErrorRuns runs;
  ErrorSum all, second;
  for (std::size_t i = 0; i < forces_N.size(); ++i) {
    const GestureSample& was = lesson.samples[i];
    const double error_N = norm(forces_N[i] - Vec3{was.force_W_N[0], was.force_W_N[1], was.force_W_N[2]});
    all.add(error_N);
    second.add(error_N);
    if ((i + 1) % kChunk == 0) runs.add(std::exchange(second, {}));
  }
  row.rms_error_n = all.rms();
  row.max_error_n = all.max();
  row.rms_error_spread_n = runs.spread();
  row.uncertainty = spreadText(runs, "seconds") + "; " + timingText(stored.encode);
}

Status addLesson(const StudyLesson& lesson, double budget_s, AccuracyRows& rows) {
  const std::vector<Vec3> before_N = recomputedForces(lesson.model, lesson.samples);
  for (const double quantum_m : kQuanta_m) {
    ASSIGN_OR_RETURN(const auto stored, throughCodec(lesson.samples, scaledResolution(quantum_m), budget_s));

    AccuracyRow row = rowOf(lesson, quantum_m, stored);
    row.reference = "the force of the tick, against the stored one";
    std::vector<Vec3> forces_N;
    for (const GestureSample& s : stored.samples)
      forces_N.push_back({s.force_W_N[0], s.force_W_N[1], s.force_W_N[2]});
    setErrors(row, lesson, forces_N, stored);
    row.cannot_show = "the disk: chunks are in memory; what a score makes of the error";
    rows.push_back(row);

    // the engine starts only where the recording starts; its output for the recorded poses is the comparator
    StudyLesson again = lesson;
    for (std::size_t i = 0; i < again.samples.size(); ++i) {
      again.samples[i].force_W_N[0] = before_N[i].x;
      again.samples[i].force_W_N[1] = before_N[i].y;
      again.samples[i].force_W_N[2] = before_N[i].z;
    }
    row.reference = "the engine's force from the poses, against that from the stored poses";
    row.model = "ENHANCED_TRACKING_WALL";
    setErrors(row, again, recomputedForces(lesson.model, stored.samples), stored);
    row.cannot_show =
        "a stop that begins a tick earlier or later counts as an error of force, which no hand would feel";
    rows.push_back(std::move(row));
  }
  return {};
}

}  // namespace

Resolution scaledResolution(double length_m) {
  if (length_m <= 0) return Resolution::lossless();
  const Resolution standard = Resolution::standard();
  const double scale = length_m / standard.length_m;
  Resolution scaled = standard;
  scaled.length_m = length_m;
  // beyond that the gate rejects the decoded quaternions
  scaled.quaternion = std::min(scaled.quaternion * scale, 0x1p-12);
  scaled.force_N *= scale;
  scaled.torque_Nm *= scale;
  scaled.speed_mps *= scale;
  return scaled;
}

Result<AccuracyRows> storageStudy(const AccuracyOptions& options, const AccuracyProgress& progress,
                                  std::vector<std::string>& notes) {
  std::vector<StudyLesson> lessons;
  ASSIGN_OR_RETURN(auto generated, generatedLesson());
  lessons.push_back(std::move(generated));
  ASSIGN_OR_RETURN(auto recorded, recordedLessons(options));
  if (recorded.empty())
    notes.push_back(
        "storage: no recordings of a real hand (set NEEDLELAB_DATA, or --data): the generated lesson only");
  for (StudyLesson& lesson : recorded) lessons.push_back(std::move(lesson));

  AccuracyRows rows;
  for (std::size_t i = 0; i < lessons.size(); ++i) {
    progress("storage: " + lessons[i].name, static_cast<double>(i) / static_cast<double>(lessons.size()));
    RETURN_IF_ERROR(addLesson(lessons[i], options.long_form ? 0.5 : 0.06, rows));
  }
  return rows;
}

}  // namespace needlelab
