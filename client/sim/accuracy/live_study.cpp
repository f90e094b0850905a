#include "client/sim/accuracy/study.h"

#include <fmt/core.h>

#include <time.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <utility>

#include "client/sim/accuracy/gesture.h"
#include "client/sim/accuracy/row.h"
#include "client/sim/accuracy/tls_loopback.h"
#include "common/base/clock.h"
#include "common/gesture/chunk.h"

namespace needlelab {
namespace {

constexpr std::array<std::size_t, 7> kFrames_ms = {5, 10, 20, 33, 50, 100, 200};
constexpr double kLiveRate_hz = 1000;

std::int64_t processorNow_ns() {
  timespec now{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<std::int64_t>(now.tv_sec) * 1'000'000'000 + now.tv_nsec;
}

// results for one frame interval
struct Passed {
  std::vector<double> transit_ns;  // of each frame: encode, send, receive, decode
  double processor_ns = 0;         // of all of them, both ends
  std::vector<double> runs_ns;     // the same of a frame, in each fifth
  double wire_bytes = 0;
};

Result<Frame> frameOf(std::span<const GestureSample> samples, std::uint64_t seq) {
  const Bytes chunk = encodeChunk(Resolution::standard(), samples);
  pb::Envelope envelope;
  pb::LiveFrame& frame = *envelope.mutable_live_frame();
  frame.set_session_id(std::string(16, '\x42'));
  frame.set_frame_seq(seq);
  frame.set_data(chunk.data(), chunk.size());
  frame.set_due_steady_ns(samples.back().time_ns);
  frame.set_capture_unix_ns(1'790'000'000'000'000'000 + samples.back().time_ns);
  return encodeFrame(envelope);
}

Result<Passed> passAll(TlsLoopback& loop, const StudyLesson& lesson, std::size_t per_frame,
                       std::size_t frames) {
  const std::size_t whole = lesson.samples.size() / per_frame;
  Passed passed;
  constexpr std::size_t kWarm = 5;
  const std::size_t per_run = frames / 5;
  std::int64_t processor_ns = 0, run_ns = 0;
  std::uint64_t bytes = 0;
  for (std::size_t i = 0; i < frames + kWarm; ++i) {
    if (i == kWarm) processor_ns = run_ns = processorNow_ns(), bytes = loop.cipherBytes();
    const auto samples = std::span(lesson.samples).subspan((i % whole) * per_frame, per_frame);
    const std::int64_t from_ns = steadyNowNs();
    ASSIGN_OR_RETURN(auto frame, frameOf(samples, i));
    ASSIGN_OR_RETURN(const auto arrived, loop.pass(std::move(frame)));
    const std::string& data = arrived.live_frame().data();
    ASSIGN_OR_RETURN(const auto back, decodeChunk(viewOf(data)));
    if (back.size() != per_frame) return Error{ErrorCode::kFailed, "a live frame arrived with other samples"};
    if (i < kWarm) continue;
    passed.transit_ns.push_back(static_cast<double>(steadyNowNs() - from_ns));
    if (passed.transit_ns.size() % per_run != 0) continue;
    const std::int64_t now_ns = processorNow_ns();
    passed.runs_ns.push_back(static_cast<double>(now_ns - std::exchange(run_ns, now_ns)) /
                             static_cast<double>(per_run));
  }
  passed.processor_ns = static_cast<double>(processorNow_ns() - processor_ns);
  passed.wire_bytes = static_cast<double>(loop.cipherBytes() - bytes);
  return passed;
}

// every sample of every frame: the wait until its frame is full, then the frame's transit
void setLatency(AccuracyRow& row, const Passed& passed, std::size_t per_frame) {
  std::vector<double> latency_ms;
  double sum = 0;
  for (const double transit_ns : passed.transit_ns)
    for (std::size_t wait = 0; wait < per_frame; ++wait) {
      latency_ms.push_back(static_cast<double>(wait) * 1e3 / kLiveRate_hz + transit_ns * 1e-6);
      sum += latency_ms.back();
    }
  row.latency_ms = sum / static_cast<double>(latency_ms.size());
  row.latency_p99_ms = timingOf(std::move(latency_ms), 1).p99_ns;  // the same quantile, in ms here
}

// the force that a viewer sees at a tick, compared with the force of that tick
void setStaleness(AccuracyRow& row, const StudyLesson& lesson, std::size_t per_frame, double transit_ms) {
  const auto late = static_cast<std::size_t>(std::ceil(transit_ms * kLiveRate_hz * 1e-3));
  ErrorRuns runs;
  ErrorSum all, second, force;
  const auto force_N = [&](std::size_t i) {
    const GestureSample& s = lesson.samples[i];
    return Vec3{s.force_W_N[0], s.force_W_N[1], s.force_W_N[2]};
  };
  for (std::size_t i = per_frame + late; i < lesson.samples.size(); ++i) {
    // the newest whole frame that has arrived by now ends here
    const std::size_t shown = (i + 1 - late) / per_frame * per_frame - 1;
    const double error_N = norm(force_N(i) - force_N(shown));
    all.add(error_N);
    second.add(error_N);
    if (lesson.samples[i].layer >= 0) force.add(norm(force_N(i)));
    if (second.count() == 1000) runs.add(std::exchange(second, {}));
  }
  row.rms_error_n = all.rms();
  row.max_error_n = all.max();
  row.rms_error_spread_n = runs.spread();
  row.noticeable_n = noticeableForce_N(force.rms());
}

AccuracyRow rowOf(const StudyLesson& lesson, std::size_t per_frame, const Passed& passed) {
  AccuracyRow row;
  row.study = AccuracyStudy::kLive;
  row.scene = lesson.name;
  row.rate_hz = kLiveRate_hz;
  row.frame_s = static_cast<double>(per_frame) / kLiveRate_hz;
  row.reference = "the lesson itself at the moment when the viewer looks";
  const Timing transit = timingOf(passed.transit_ns, 1);
  setLatency(row, passed, per_frame);
  setStaleness(row, lesson, per_frame, transit.median_ns * 1e-6);
  const auto frames = static_cast<double>(passed.transit_ns.size());
  const double frames_per_s = 1 / *row.frame_s;
  row.bytes_per_sample = passed.wire_bytes / frames / static_cast<double>(per_frame);
  row.bytes_per_s = passed.wire_bytes / frames * frames_per_s;
  row.cpu_share = passed.processor_ns / frames * 1e-9 * frames_per_s;
  row.median_ns = passed.processor_ns / frames / static_cast<double>(per_frame);
  CostInterval runs_ns = intervalOf(passed.runs_ns);
  for (double* ns : {&runs_ns.value, &runs_ns.low, &runs_ns.high}) *ns /= static_cast<double>(per_frame);
  row.runs_ns = runs_ns;
  row.p99_ns = transit.p99_ns / static_cast<double>(per_frame);
  row.fits_rate = transit.p99_ns * 1e-9 <= *row.frame_s;
  const std::string text = fmt::format(
      "a frame's way over TLS on 127.0.0.1: median {:.0f} us, p99 {:.0f} us, of {:.0f} frames; waits "
      "computed; force ± {:.2g} N (sd over seconds)",
      transit.median_ns * 1e-3, transit.p99_ns * 1e-3, frames, *row.rms_error_spread_n);
  row.uncertainty = text;
  row.cannot_show =
      "a network: one hop on one machine, hot, one station, no server between; headers of TCP and IP; the "
      "viewer's redraw";
  return row;
}

}  // namespace

Result<AccuracyRows> liveStudy(const AccuracyOptions& options, const AccuracyProgress& progress,
                               std::vector<std::string>& /*notes*/) {
  ASSIGN_OR_RETURN(const auto lesson, generatedLesson());
  ASSIGN_OR_RETURN(const auto loop, TlsLoopback::open());
  AccuracyRows rows;
  for (const std::size_t per_frame : kFrames_ms) {
    progress(fmt::format("live: frames of {} ms", per_frame),
             static_cast<double>(rows.size()) / static_cast<double>(kFrames_ms.size()));
    ASSIGN_OR_RETURN(const auto passed, passAll(*loop, lesson, per_frame, options.long_form ? 5000 : 500));
    rows.push_back(rowOf(lesson, per_frame, passed));
  }
  return rows;
}

}  // namespace needlelab
