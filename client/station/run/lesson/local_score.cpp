#include "client/station/run/lesson/local_score.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "common/base/text/strict_json.h"
#include "common/gesture/chunk.h"
#include "common/haptics/body/path_snapshot.h"
#include "common/haptics/effects/line_layers.h"
#include "common/haptics/scene_model.h"
#include "common/haptics/surface.h"
#include "common/scoring/measures/measures.h"
#include "common/scoring/measures/syringe_events.h"

namespace needlelab {
namespace {

double forceIn(const GestureSample& s) {
  return std::hypot(s.force_W_N[0], s.force_W_N[1], s.force_W_N[2]);
}

Vec3 tipOf(const GestureSample& s) {
  return {s.p_WT_m[0], s.p_WT_m[1], s.p_WT_m[2]};
}

bool isFinitePoint(const GestureSample& s) {
  return std::isfinite(s.p_WT_m[0] + s.p_WT_m[1] + s.p_WT_m[2] + forceIn(s) + s.insertion_m +
                       s.lateral_error_m + s.speed_mps);
}

// What the capped needle presses is the skin.
double depthOf(const Limb& limb_W, const GestureSample& sample) {
  if ((sample.flags & kFlagCapped) != 0) return std::numeric_limits<double>::quiet_NaN();
  if (sample.layer >= 0) return static_cast<double>(sample.insertion_m);
  return signedDepth(limb_W, tipOf(sample));
}

constexpr double kLine_m = 1e-3;                  // a shorter way has no direction
constexpr std::uint64_t kMaxSamples = 2'000'000;  // half an hour at 1 kHz, half a gigabyte

}  // namespace

GestureCurve gestureCurve(std::span<const GestureSample> samples, const Limb& limb_W, std::size_t max_points,
                          const std::optional<PlannedLine>& plan_W) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  GestureCurve curve;
  if (samples.empty() || max_points == 0) return curve;
  const std::size_t group = (samples.size() + max_points - 1) / max_points;
  curve.reserve((samples.size() + group - 1) / group);
  for (std::size_t begin = 0; begin < samples.size(); begin += group) {
    const GestureSample* strongest = nullptr;
    double lateral_m = nan, planned_m = nan;  // greatest in tissue, where the measures are taken
    for (const GestureSample& s : samples.subspan(begin, std::min(group, samples.size() - begin))) {
      if (!isFinitePoint(s)) continue;
      if (strongest == nullptr || forceIn(s) > forceIn(*strongest)) strongest = &s;
      if (s.layer < 0) continue;
      lateral_m = std::fmax(lateral_m, s.lateral_error_m);
      if (plan_W) planned_m = std::fmax(planned_m, distanceFrom(*plan_W, tipOf(s)));
    }
    if (strongest == nullptr) continue;
    const GestureSample& s = *strongest;
    curve.push_back({static_cast<float>(1e-9 * static_cast<double>(s.time_ns - samples.front().time_ns)),
                     static_cast<float>(depthOf(limb_W, s)), static_cast<float>(forceIn(s)),
                     static_cast<float>(std::isnan(lateral_m) ? s.lateral_error_m : lateral_m),
                     static_cast<float>(planned_m), s.layer});
  }
  return curve;
}

void DeepestLine::take(std::span<const GestureSample> samples, ByteView paths) {
  const std::vector<PathSnapshot> snapshots = pathsIn(paths);
  auto next = snapshots.begin();
  for (const GestureSample& s : samples) {
    if ((s.flags & kFlagEntry) != 0) path_ = nullptr, entry_W_m_ = tipOf(s);
    const bool held = path_ && entry_W_m_ && isHeldBack(norm(tipOf(s) - *entry_W_m_), s.insertion_m);
    for (; next != snapshots.end() && next->tick <= s.tick; ++next)
      if (!held) path_ = std::make_shared<const PathLayers>(next->path);
    const bool in_tissue = s.layer >= 0 && (s.flags & (kFlagCapped | kFlagNotStepped)) == 0;
    if (!in_tissue || !isFinitePoint(s) || !(s.insertion_m > insertion_m_)) continue;
    insertion_m_ = s.insertion_m;
    const Vec3 axis_W = normalized(zAxis(Quat{s.q_WT[0], s.q_WT[1], s.q_WT[2], s.q_WT[3]}));
    const Vec3 begin_W_m = entry_W_m_.value_or(tipOf(s) - axis_W * s.insertion_m);
    const Vec3 way_W_m = tipOf(s) - begin_W_m;
    line_ = NeedleLine{begin_W_m, norm(way_W_m) > kLine_m ? normalized(way_W_m) : axis_W, 1, path_};
    if (path_) line_->slant = slantOf(path_->normal_W, line_->u_W);
  }
}

Result<LocalScore> localScore(const SpoolSession& session, const StationLesson& lesson, const Pose& X_WL) {
  const SpoolContents contents = session.contents();
  if (contents.samples > kMaxSamples)
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("the session has {} samples, the station scores at most {}; the server will",
                             contents.samples, kMaxSamples)};
  std::vector<GestureSample> samples;
  DeepestLine deepest;
  samples.reserve(contents.samples);
  for (std::uint64_t seq = 0; seq < contents.chunks; ++seq) {
    ASSIGN_OR_RETURN(auto chunk, session.readChunk(seq));
    ASSIGN_OR_RETURN(auto some, decodeChunk(chunk));
    deepest.take(some, pathListOf(chunk));
    samples.insert(samples.end(), some.begin(), some.end());
  }
  if (samples.empty()) return Error{ErrorCode::kNotFound, "nothing was recorded"};
  const auto measures = scoreGesture(samples, session.description().rate_hz(), lesson.profile, X_WL,
                                     lesson.exercise ? &*lesson.exercise : nullptr);
  auto plan = lesson.exercise ? plannedLineOf(*lesson.exercise, X_WL) : std::nullopt;
  if (plan) plan = onSkin(*plan, lesson.model.limb).value_or(*plan);
  const auto events = syringeEvents(samples, session.description().rate_hz(), lesson.profile, X_WL);
  return LocalScore{scoreJson(measures), eventsJson(events),
                    gestureCurve(samples, lesson.model.limb, kCurvePoints, plan),
                    missOf(samples, events, lesson.profile, X_WL), deepest.line()};
}

std::vector<TickSpan> injectionsIn(const std::string& events_json) {
  std::vector<TickSpan> found;
  const auto rows = readShallowJson<nlohmann::json>(events_json);
  if (!rows.is_array()) return found;
  for (const auto& row : rows) {
    if (!row.is_object() || row.value("event", "") != "INJECTION") continue;
    if (!row.value(nlohmann::json::json_pointer("/begin/in_tissue"), false)) continue;
    found.push_back({row.value("begin_tick", std::uint64_t{0}), row.value("end_tick", std::uint64_t{0})});
  }
  return found;
}

}  // namespace needlelab
