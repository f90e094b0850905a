#include "client/instructor/model/stored/comparison.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include <fmt/core.h>

#include "common/base/text/text.h"
#include "common/scoring/measures/measure_table.h"
#include "common/scoring/motion/dtw.h"

namespace needlelab {
namespace {

constexpr double kDepthStep_m = 0.00025;
constexpr double kTimeStep_s = 0.01;
constexpr std::size_t kMaxPoints = 20'000;

double forceOfSample(const GestureSample& s) {
  return norm({s.force_W_N[0], s.force_W_N[1], s.force_W_N[2]});
}

Vec3 tipInLimb(const StoredGesture& gesture, const GestureSample& s) {
  return inverse(gesture.scene.X_WL) * Vec3{s.p_WT_m[0], s.p_WT_m[1], s.p_WT_m[2]};
}

/// Both sides of a point, from one sample of each gesture.
ComparedPoint pointOf(const StoredGesture& a, std::size_t i, const StoredGesture& b, std::size_t j) {
  const GestureSample& sa = a.samples[i];
  const GestureSample& sb = b.samples[j];
  ComparedPoint point;
  point.time_a_s = a.timeOfTick(sa.tick);
  point.time_b_s = b.timeOfTick(sb.tick);
  point.force_a_N = forceOfSample(sa);
  point.force_b_N = forceOfSample(sb);
  point.speed_a_mps = sa.speed_mps;
  point.speed_b_mps = sb.speed_mps;
  point.lateral_a_m = sa.lateral_error_m;
  point.lateral_b_m = sb.lateral_error_m;
  const auto offPlan = [](const StoredGesture& g, const GestureSample& s) {
    return g.plan_W && s.layer >= 0 ? distanceFrom(*g.plan_W, {s.p_WT_m[0], s.p_WT_m[1], s.p_WT_m[2]})
                                    : std::numeric_limits<double>::quiet_NaN();
  };
  point.planned_a_m = offPlan(a, sa);
  point.planned_b_m = offPlan(b, sb);
  point.insertion_a_m = sa.insertion_m;
  point.insertion_b_m = sb.insertion_m;
  const auto tiltOf = [](const StoredGesture& g, double at_s) {
    return g.trace.value(TraceChannel::kTilt, at_s).value_or(std::numeric_limits<float>::quiet_NaN());
  };
  point.tilt_a_rad = static_cast<double>(tiltOf(a, point.time_a_s));
  point.tilt_b_rad = static_cast<double>(tiltOf(b, point.time_b_s));
  point.apart_m = norm(tipInLimb(a, sa) - tipInLimb(b, sb));
  return point;
}

/// Samples of one insertion, [first, last].
struct Insertion {
  std::size_t first = 0, last = 0, deepest = 0;
};

/// Returns the deepest insertion; nullopt if the gesture was never in tissue.
std::optional<Insertion> deepestInsertion(const std::vector<GestureSample>& samples) {
  std::optional<Insertion> best;
  double best_m = 0;
  for (std::size_t i = 0; i < samples.size();) {
    if (samples[i].layer < 0) {
      ++i;
      continue;
    }
    Insertion one{i, i, i};
    for (; i < samples.size() && samples[i].layer >= 0; ++i) {
      one.last = i;
      if (samples[i].insertion_m > samples[one.deepest].insertion_m) one.deepest = i;
    }
    if (!best || samples[one.deepest].insertion_m > best_m) {
      best = one;
      best_m = samples[one.deepest].insertion_m;
    }
  }
  return best;
}

Error neverIn(const StoredGesture& gesture) {
  return {ErrorCode::kInvalidInput,
          "the needle of " + gesture.title() + " was never in tissue: nothing to compare"};
}

Status byDepth(const StoredGesture& a, const StoredGesture& b, std::vector<ComparedPoint>& points) {
  const auto in_a = deepestInsertion(a.samples), in_b = deepestInsertion(b.samples);
  if (!in_a) return neverIn(a);
  if (!in_b) return neverIn(b);
  const double to_m = std::min(a.samples[in_a->deepest].insertion_m, b.samples[in_b->deepest].insertion_m);
  std::size_t i = in_a->first, j = in_b->first;
  for (std::size_t k = 0; points.size() < kMaxPoints; ++k) {
    const double depth_m = static_cast<double>(k) * kDepthStep_m;
    if (depth_m > to_m) break;
    while (i < in_a->deepest && a.samples[i].insertion_m < depth_m) ++i;
    while (j < in_b->deepest && b.samples[j].insertion_m < depth_m) ++j;
    points.push_back(pointOf(a, i, b, j));
    points.back().at = depth_m;
  }
  return {};
}

/// A gesture's path for warping, and its points' times. Limits the gesture's duration as tipPathOf does.
struct TimedPath {
  TipPath path;
  std::vector<double> times_s;
};

TimedPath timedPathOf(const StoredGesture& gesture) {
  TimedPath timed;
  timed.path = tipPathOf(gesture.samples, gesture.rate_hz, gesture.scene.X_WL);
  const auto inside = [](const GestureSample& s) { return s.layer >= 0; };
  const auto first = std::find_if(gesture.samples.begin(), gesture.samples.end(), inside);
  if (first == gesture.samples.end()) return timed;
  const double from_s = gesture.timeOfTick(first->tick);
  for (std::size_t i = 0; i < timed.path.size(); ++i)
    timed.times_s.push_back(from_s + static_cast<double>(i) / kPathRateHz);
  return timed;
}

Status byWarping(const StoredGesture& a, const StoredGesture& b, GestureComparison& comparison) {
  const TimedPath pa = timedPathOf(a), pb_ = timedPathOf(b);
  if (pa.path.empty()) return neverIn(a);
  if (pb_.path.empty()) return neverIn(b);
  const auto aligned = dtwAlignment(pa.path, pb_.path);
  if (!aligned)
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("a gesture of more than {} minutes in tissue cannot be warped; compare by depth",
                             static_cast<int>(kMaxPathPoints / kPathRateHz / 60))};
  comparison.dtw_distance_m = aligned->distance_m;
  const double steps = std::max<double>(1, static_cast<double>(aligned->pairs.size()) - 1);
  for (std::size_t k = 0; k < aligned->pairs.size(); ++k) {
    const DtwPair& pair = aligned->pairs[k];
    ComparedPoint point = pointOf(a, a.sampleAt(pa.times_s[pair.a]), b, b.sampleAt(pb_.times_s[pair.b]));
    point.at = static_cast<double>(k) / steps;
    point.apart_m = norm(pa.path[pair.a] - pb_.path[pair.b]);
    comparison.points.push_back(point);
  }
  return {};
}

Status byTime(const StoredGesture& a, const StoredGesture& b, std::vector<ComparedPoint>& points) {
  const auto inside = [](const GestureSample& s) { return s.layer >= 0; };
  const auto first_a = std::find_if(a.samples.begin(), a.samples.end(), inside);
  const auto first_b = std::find_if(b.samples.begin(), b.samples.end(), inside);
  if (first_a == a.samples.end()) return neverIn(a);
  if (first_b == b.samples.end()) return neverIn(b);
  const double from_a_s = a.timeOfTick(first_a->tick), from_b_s = b.timeOfTick(first_b->tick);
  const double length_s = std::min(a.timeOfTick(a.samples.back().tick) - from_a_s,
                                   b.timeOfTick(b.samples.back().tick) - from_b_s);
  const double step_s = std::max(kTimeStep_s, length_s / static_cast<double>(kMaxPoints - 1));
  for (std::size_t k = 0; points.size() < kMaxPoints; ++k) {
    const double at_s = static_cast<double>(k) * step_s;
    if (at_s > length_s) break;
    points.push_back(pointOf(a, a.sampleAt(from_a_s + at_s), b, b.sampleAt(from_b_s + at_s)));
    points.back().at = at_s;
  }
  return {};
}

struct SeriesStyle {
  std::string_view word, unit;
  double shown_per_si;
  int decimals;
  std::optional<GesturePlot> plot;  ///< the plot of a gesture that shows the same quantity
};
constexpr std::array<SeriesStyle, kComparedSeriesCount> kSeries = {
    {{"force", "N", 1, 2, GesturePlot::kForces},
     {"speed", "mm/s", 1000, 1, GesturePlot::kSpeed},
     {"distance from own line", "mm", 1000, 2, GesturePlot::kAlignment},
     {"distance from planned line", "mm", 1000, 2, std::nullopt},
     {"inserted length", "mm", 1000, 2, std::nullopt},
     {"tilt from own line", "°", 57.29577951308232, 1, GesturePlot::kAngles}}};

std::string whereText(Alignment alignment, const ComparedPoint& point) {
  switch (alignment) {
    case Alignment::kDepth:
      return fmt::format("at {:.1f} mm", 1e3 * point.at);
    case Alignment::kTime:
      return fmt::format("{:.1f} s after the entry", point.at);
    case Alignment::kDtw:
      break;
  }
  return fmt::format("at {:.1f} s of the first", point.time_a_s);
}

/// Mean and maximum difference of a series.
std::optional<std::string> sentenceOf(const GestureComparison& comparison, ComparedSeries series) {
  const SeriesStyle& style = kSeries[static_cast<std::size_t>(series)];
  double sum = 0, greatest = 0;
  std::size_t n = 0;
  const ComparedPoint* where = nullptr;
  for (const ComparedPoint& point : comparison.points) {
    const double d = valueOfB(series, point) - valueOfA(series, point);
    if (!std::isfinite(d)) continue;
    ++n;
    sum += d;
    if (where == nullptr || std::abs(d) > std::abs(greatest)) {
      greatest = d;
      where = &point;
    }
  }
  if (where == nullptr) return std::nullopt;
  const double k = style.shown_per_si;
  const auto text = [&](double difference) { return fixedText(k * difference, style.decimals, Sign::kBoth); };
  return fmt::format("{}: the second differs by {} {} on average, by {} {} at most, {}", style.word,
                     text(sum / static_cast<double>(n)), style.unit, text(greatest), style.unit,
                     whereText(comparison.alignment, *where));
}

void describeDifferences(GestureComparison& comparison) {
  for (const auto series : {ComparedSeries::kTotalForce, ComparedSeries::kSpeed, ComparedSeries::kLateral,
                            ComparedSeries::kPlanned}) {
    if (auto sentence = sentenceOf(comparison, series)) comparison.sentences.push_back(std::move(*sentence));
  }
  if (comparison.alignment == Alignment::kDtw)
    comparison.sentences.push_back(fmt::format(
        "paths: {:.1f} mm apart on average when warped onto each other", 1e3 * comparison.dtw_distance_m));
}

}  // namespace

std::string_view nameOf(Alignment alignment) {
  switch (alignment) {
    case Alignment::kDepth:
      return "depth";
    case Alignment::kDtw:
      return "dtw";
    case Alignment::kTime:
      break;
  }
  return "time";
}

void addLimits(Plot& plot, ComparedSeries series, const StoredGesture& a, const StoredGesture& b) {
  if (a.info.description().exercise_id() != b.info.description().exercise_id()) return;
  const auto& requirements = a.requirements.empty() ? b.requirements : a.requirements;
  const SeriesStyle& style = kSeries[static_cast<std::size_t>(series)];
  if (style.plot) addLimits(plot, *style.plot, requirements);
  // Only the comparison plots the distance from the planned line.
  if (series != ComparedSeries::kPlanned) return;
  for (const PlotRequirement& requirement : requirements)
    if (roleOf(requirement.measure) == MeasureRole::kPlannedLine)
      addLimits(plot, requirement, style.shown_per_si);
}

SharedPlan sharedPlanOf(const StoredGesture& a, const StoredGesture& b) {
  // Placements are stored as doubles; differences below 0.01 mm do not matter.
  constexpr double kSame_m = 1e-5, kSame = 1e-4;
  if (!a.plan_W && !b.plan_W) return {};
  if (!a.plan_W || !b.plan_W)
    return {
        {},
        fmt::format("Only the {} has a planned line; it is not drawn here.", a.plan_W ? "first" : "second")};
  if (norm(a.plan_W->entry_m - b.plan_W->entry_m) > kSame_m ||
      norm(a.plan_W->direction - b.plan_W->direction) > kSame)
    return {{}, "The two have different planned lines; neither is drawn here."};
  return {a.planView(), {}};
}

std::string_view nameOf(ComparedSeries series) {
  return kSeries[static_cast<std::size_t>(series)].word;
}

std::string_view unitOf(ComparedSeries series) {
  return kSeries[static_cast<std::size_t>(series)].unit;
}

double shownPerSi(ComparedSeries series) {
  return kSeries[static_cast<std::size_t>(series)].shown_per_si;
}

double valueOfA(ComparedSeries series, const ComparedPoint& point) {
  switch (series) {
    case ComparedSeries::kTotalForce:
      return point.force_a_N;
    case ComparedSeries::kSpeed:
      return point.speed_a_mps;
    case ComparedSeries::kLateral:
      return point.lateral_a_m;
    case ComparedSeries::kPlanned:
      return point.planned_a_m;
    case ComparedSeries::kInsertion:
      return point.insertion_a_m;
    case ComparedSeries::kTilt:
      break;
  }
  return point.tilt_a_rad;
}

double valueOfB(ComparedSeries series, const ComparedPoint& point) {
  switch (series) {
    case ComparedSeries::kTotalForce:
      return point.force_b_N;
    case ComparedSeries::kSpeed:
      return point.speed_b_mps;
    case ComparedSeries::kLateral:
      return point.lateral_b_m;
    case ComparedSeries::kPlanned:
      return point.planned_b_m;
    case ComparedSeries::kInsertion:
      return point.insertion_b_m;
    case ComparedSeries::kTilt:
      break;
  }
  return point.tilt_b_rad;
}

std::vector<ComparedSeries> plottedSeries(const GestureComparison& comparison) {
  std::vector<ComparedSeries> series = {ComparedSeries::kTotalForce, ComparedSeries::kSpeed,
                                        ComparedSeries::kLateral};
  if (std::any_of(comparison.points.begin(), comparison.points.end(), [](const ComparedPoint& point) {
        return std::isfinite(point.planned_a_m) || std::isfinite(point.planned_b_m);
      }))
    series.push_back(ComparedSeries::kPlanned);
  series.push_back(ComparedSeries::kTilt);
  return series;
}

Result<GestureComparison> compareGestures(const StoredGesture& a, const StoredGesture& b,
                                          Alignment alignment) {
  if (a.samples.empty()) return neverIn(a);
  if (b.samples.empty()) return neverIn(b);
  GestureComparison comparison;
  comparison.alignment = alignment;
  Status done;
  switch (alignment) {
    case Alignment::kDepth:
      done = byDepth(a, b, comparison.points);
      break;
    case Alignment::kDtw:
      done = byWarping(a, b, comparison);
      break;
    case Alignment::kTime:
      done = byTime(a, b, comparison.points);
      break;
  }
  if (!done.ok()) return done.error();
  const std::string& exercise_a = a.info.description().exercise_id();
  const std::string& exercise_b = b.info.description().exercise_id();
  if (exercise_a != exercise_b)
    comparison.sentences.push_back("two different exercises (" + exercise_a + ", " + exercise_b +
                                   "): differences may come from the task, not the hand");
  describeDifferences(comparison);
  return comparison;
}

}  // namespace needlelab
