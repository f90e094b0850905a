#include "common/scoring/measures/measures.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "common/haptics/scene_spec.h"
#include "common/profile/layer_names.h"
#include "common/scoring/measures/measure_groups.h"
#include "common/scoring/measures/measure_table.h"
#include "common/scoring/measures/syringe_events.h"
#include "common/scoring/motion/motion_cost.h"
#include "common/scoring/motion/track.h"

namespace needlelab {
namespace {

/// Area that the shaft sweeps from one point of the track to the next with `length_m` of it in tissue: the
/// shaft's points p − s·axis, s ∈ [0, length], move in straight lines, and only their movement across the
/// shaft sweeps. Midpoint rule over 8 pieces (the integrand is the norm of a linear function of s).
double sweptArea(const TrackPoint& a, const TrackPoint& b, double length_m) {
  constexpr int kPieces = 8;
  const Vec3 axis = a.axis_W + b.axis_W;
  if (!(normSquared(axis) > 1e-12) || !(length_m > 0)) return 0;
  const Vec3 along = normalized(axis);
  const Vec3 tip = b.p_WT_m - a.p_WT_m, turn = b.axis_W - a.axis_W;
  double sum = 0;
  for (int i = 0; i < kPieces; ++i) {
    const Vec3 moved = tip - ((i + 0.5) / kPieces * length_m) * turn;
    sum += norm(moved - dot(moved, along) * along);
  }
  return sum / kPieces * length_m;
}

/// A movement begins above `begin_per_s` and ends when the speed stays below `end_per_s` for
/// `kActionPause_s`; distances below `least` do not count. Units: m and m/s, or rad and rad/s.
struct ActionLimits {
  double begin_per_s, end_per_s, least;
};
constexpr ActionLimits kTranslation{3e-3, 1.5e-3, 2e-3};
constexpr ActionLimits kRotation{0.1, 0.05, 0.05};
constexpr double kActionPause_s = 0.1;
/// Speeds are measured over straight lines to this many points on either side: 0.1 s, one period of tremor
/// (8-12 Hz).
constexpr std::size_t kActionReach = 5;

/// Movement from point i of a run to the next, as a share of the straight line over 0.1 s around it.
template <typename F>
double chordStep(const Run& run, std::size_t i, const F& quantity) {
  const std::size_t from = i < kActionReach ? 0 : i - kActionReach + 1;
  const std::size_t to = std::min(i + kActionReach, run.inside.size());
  return norm(quantity(run.points[to]) - quantity(run.points[from])) / static_cast<double>(to - from);
}

/// Steps [first, end) of a run.
struct Stretch {
  std::size_t first = 0, end = 0;
  double way = 0;  ///< distance in it, m or rad; only for movements
};

/// The movements of a run, in order. Each reaches from the step in which the speed last rose above
/// `end_per_s` to the last step above it.
template <typename F>
std::vector<Stretch> movementsOf(const Run& run, const ActionLimits& limits, const F& quantity) {
  std::vector<Stretch> movements;
  Stretch now;
  std::size_t rise = 0;
  double slow_s = 0;
  bool moving = false;
  const auto finish = [&] {
    if (moving && now.way >= limits.least) movements.push_back(now);
    moving = false;
  };
  for (std::size_t i = 0; i < run.inside.size(); ++i) {
    const double step = chordStep(run, i, quantity), speed = step / run.period_s;
    const bool slow = speed < limits.end_per_s;
    if (!moving && speed > limits.begin_per_s) {
      moving = true;
      now.first = rise;
      now.way = slow_s = 0;
    }
    if (moving) {
      now.way += step;
      slow_s = slow ? slow_s + run.period_s : 0;
      if (!slow) now.end = i + 1;
      if (slow_s >= kActionPause_s * (1 - 1e-9)) finish();
    }
    if (slow) rise = i + 1;
  }
  finish();
  return movements;
}

std::vector<Stretch> tipMovementsOf(const Run& run) {
  return movementsOf(run, kTranslation, [](const TrackPoint& p) { return p.p_WT_m; });
}

std::vector<double> speedsOf(const Run& run, const Stretch& stretch) {
  std::vector<double> speeds;
  for (std::size_t i = stretch.first; i <= stretch.end; ++i) speeds.push_back(norm(run.points[i].v_WT_mps));
  return speeds;
}

/// A stretch of one of the gesture's runs; `run` is null if there is none.
struct RunStretch {
  const Run* run = nullptr;
  Stretch stretch;
  bool in_tissue = false;
};

/// Returns the part of the longest run from the first to the last moment in tissue; for gestures that never
/// enter tissue, the whole longest run.
RunStretch firstEntryToLastExit(const Gesture& gesture) {
  RunStretch best;
  double longest_s = 0;
  for (const Run& run : gesture.runs) {
    if (run.inside.empty()) continue;
    const auto isIn = [](double share) { return share > 0; };
    const auto first = std::find_if(run.inside.begin(), run.inside.end(), isIn);
    const auto last = std::find_if(run.inside.rbegin(), run.inside.rend(), isIn);
    const bool in_tissue = first != run.inside.end();
    const auto begin = in_tissue ? static_cast<std::size_t>(first - run.inside.begin()) : 0;
    const auto end = in_tissue ? static_cast<std::size_t>(run.inside.rend() - last) : run.inside.size();
    const double length_s = static_cast<double>(end - begin) * run.period_s;
    if (best.run == nullptr || (in_tissue && !best.in_tissue) ||
        (in_tissue == best.in_tissue && length_s > longest_s)) {
      best = {&run, {begin, end, 0}, in_tissue};
      longest_s = length_s;
    }
  }
  return best;
}

/// The mean SPARC of the tip's movements that reach into tissue (of all movements if none does), weighted by
/// distance, so that a short correction changes little. SPARC compares single movements; over several with
/// rests in between, it mostly counts the rests (Balasubramanian et al. 2015, "On the analysis of movement
/// smoothness"). A gesture that is too slow to have a movement counts as one: `whole`. Uses at most the first
/// `kLongestProfile` points.
std::optional<double> sparcOfMovements(const Gesture& gesture, const RunStretch& whole) {
  double sum = 0, way_m = 0;
  std::size_t points = 0;
  for (const Run& run : gesture.runs) {
    for (const Stretch& movement : tipMovementsOf(run)) {
      const auto first = run.inside.begin() + static_cast<std::ptrdiff_t>(movement.first);
      const auto end = run.inside.begin() + static_cast<std::ptrdiff_t>(movement.end);
      if (whole.in_tissue && std::none_of(first, end, [](double share) { return share > 0; })) continue;
      points += movement.end - movement.first + 1;
      if (points > kLongestProfile) break;
      const auto value = sparc(speedsOf(run, movement), 1 / run.period_s);
      if (!value) continue;
      sum += *value * movement.way;
      way_m += movement.way;
    }
  }
  if (way_m > 0) return sum / way_m;
  return sparc(speedsOf(*whole.run, whole.stretch), 1 / whole.run->period_s);
}

}  // namespace

/// - `elapsed_s`: last tick minus first tick.
/// - `path_m`: sum of the tip's steps on the track. `path_in_m`: each step times the share of its time in
///   tissue. `time_s`: of the runs. `time_in_s`: sum of the time shares in tissue.
/// - `peak_mps`: greatest central difference on the track.
/// - `swept_m2`: area swept by the shaft inside tissue; straight in and out sweeps none.
/// - `sparc`: of the tip's speed (track.h) in each movement, as counted by `movements`; their mean, weighted
///   by distance. `ldlj`: of the tip's speed from the first entry to the last exit, rests included.
void findMotion(GestureFacts& facts) {
  const Gesture& gesture = *facts.gesture;
  for (const Run& run : gesture.runs) {
    for (const TrackPoint& point : run.points)
      facts.peak_mps = std::max(facts.peak_mps, norm(point.v_WT_mps));
    for (std::size_t i = 0; i < run.inside.size(); ++i) {
      const TrackPoint &a = run.points[i], &b = run.points[i + 1];
      const double step_m = norm(b.p_WT_m - a.p_WT_m);
      facts.path_m += step_m;
      facts.path_in_m += step_m * run.inside[i];
      facts.time_s += run.period_s;
      facts.time_in_s += run.period_s * run.inside[i];
      facts.swept_m2 += run.inside[i] * sweptArea(a, b, 0.5 * (a.insertion_m + b.insertion_m));
    }
  }
  const auto& samples = gesture.samples;
  if (!samples.empty()) facts.elapsed_s = secondsBetween(samples.front(), samples.back(), gesture.rate_hz);

  const RunStretch whole = firstEntryToLastExit(gesture);
  if (whole.run == nullptr) return;
  facts.sparc = sparcOfMovements(gesture, whole);
  facts.ldlj = ldlj(speedsOf(*whole.run, whole.stretch), 1 / whole.run->period_s);
}

/// Movements of the tip and turns of the axis, counted on the track, in tissue and outside.
void findActions(GestureFacts& facts) {
  for (const Run& run : facts.gesture->runs) {
    facts.movements += static_cast<int>(tipMovementsOf(run).size());
    facts.turns +=
        static_cast<int>(movementsOf(run, kRotation, [](const TrackPoint& p) { return p.axis_W; }).size());
  }
}

/// Distance of the path (dtw.h) from the nearest reference, if there are references and the tip was in
/// tissue.
void findNearest(const Pose& X_WL, std::span<const TipPath> references, GestureFacts& facts) {
  if (references.empty()) return;
  const TipPath path = pathInTissue(facts.gesture->runs, X_WL, kPathRateHz, kMaxPathPoints);
  for (const TipPath& reference : references) {
    const auto distance = dtwDistance(path, reference);
    if (distance && (!facts.expert_path_m || *distance < *facts.expert_path_m))
      facts.expert_path_m = distance;
  }
}

std::vector<Measure> measuresOf(const GestureFacts& facts, std::span<const std::string> layer_names) {
  std::vector<Measure> rows;
  const auto add = [&](const MeasureKind& kind, std::string name, std::size_t layer) {
    const std::optional<double> value = kind.value(facts, layer);
    if (!value || !std::isfinite(*value)) return;
    Measure row;
    row.name = std::move(name);
    row.value = *value + 0.0;  // −0 becomes 0
    row.unit = kind.unit;
    row.words = measureWords(row.name, layer_names);
    if (kind.detail != nullptr) row.words += kind.detail(facts);
    rows.push_back(std::move(row));
  };
  for (const MeasureKind& kind : measureKinds()) {
    std::string name(kind.name);
    const std::size_t k = name.find('K');
    if (k == std::string::npos) {
      add(kind, std::move(name), 0);
      continue;
    }
    for (std::size_t i = 0; i < facts.layers.size(); ++i)
      add(kind, std::string(name).replace(k, 1, std::to_string(i + 1)), i);
  }
  return rows;
}

std::vector<Measure> scoreGesture(std::span<const GestureSample> samples, double rate_hz,
                                  const pb::Profile& profile, const Pose& X_WL, const pb::Exercise* exercise,
                                  std::span<const TipPath> references) {
  return scoreGesture(RecordedSamples(samples), rate_hz, profile, X_WL, exercise, references);
}

namespace {

double dwellOf(const pb::Exercise* exercise) {
  return exercise != nullptr && exercise->has_target_dwell_s() ? exercise->target_dwell_s() : 0.5;
}

}  // namespace

/// The parts of a score, in the order in which they are made.
struct GestureScore::Parts {
  enum class Stage { kMotionCost, kRuns, kMotion, kActions, kSamples, kGroups, kSyringe, kReferences, kDone };

  /// Does the stage or a part of it. Returns false if the step ends first.
  bool goOn(StepWork& work);
  /// Passes each sample once to all groups.
  bool passOver(StepWork& work);

  const RecordedSamples& samples;
  const double rate_hz;
  const pb::Profile& profile;
  const Pose X_WL;
  const pb::Exercise* const exercise;
  const std::span<const TipPath> references;

  Stage stage = Stage::kMotionCost;
  MotionCheck motion_cost{samples, rate_hz};
  RunsInSteps runs{samples, rate_hz};
  std::optional<Gesture> gesture{};
  std::vector<std::unique_ptr<SampleGroup>> groups{};
  std::unique_ptr<SyringeEventsInSteps> syringe{};
  std::size_t next_sample = 0, groups_done = 0;
  GestureFacts facts{};
  std::vector<Measure> measures{};
  std::vector<pb::SyringeEvent> events{};
};

bool GestureScore::Parts::passOver(StepWork& work) {
  const Anatomy& anatomy = gesture->anatomy;
  // a shaft is followed along a structure in steps
  constexpr std::uint64_t kStructureAsSamples = 16;
  const auto structures = static_cast<std::uint64_t>(std::ranges::count_if(
      anatomy.hazards, [](const Region& hazard) { return hazard.structure != nullptr; }));
  const std::uint64_t cost = 1 + (anatomy.targets.size() + anatomy.hazards.size()) / kRegionsAsASample +
                             kStructureAsSamples * structures;
  for (; next_sample < samples.size(); ++next_sample) {
    if (work.isOver()) return false;
    work.spend(cost);
    for (const auto& group : groups) group->add(next_sample);
    syringe->add(next_sample);
  }
  return true;
}

bool GestureScore::Parts::goOn(StepWork& work) {
  // a point of the motion costs as much as several samples, and these stages cannot be divided
  constexpr std::uint64_t kPointAsSamples = 4;
  const auto spendPoints = [&] {
    for (const Run& run : gesture->runs) work.spend(kPointAsSamples * run.points.size());
  };
  switch (stage) {
    case Stage::kMotionCost:
      if (!motion_cost.step(work)) return false;
      stage = motion_cost.status().ok() ? Stage::kRuns : Stage::kDone;
      return true;
    case Stage::kRuns:
      if (!runs.step(work)) return false;
      gesture.emplace(
          Gesture{samples, rate_hz, runs.take(), anatomyOf(profile, X_WL), &profile, {}, dwellOf(exercise)});
      if (exercise != nullptr) gesture->plan_W = plannedLineOf(*exercise, X_WL);
      if (gesture->plan_W && gesture->anatomy.has_limb)
        gesture->plan_W = onSkin(*gesture->plan_W, gesture->anatomy.limb).value_or(*gesture->plan_W);
      facts.gesture = &*gesture;
      groups = sampleGroups(facts);
      syringe = syringeEventsInSteps(samples, rate_hz, profile, X_WL);
      stage = Stage::kMotion;
      return true;
    case Stage::kMotion:
      findMotion(facts);
      spendPoints();
      stage = Stage::kActions;
      return true;
    case Stage::kActions:
      findActions(facts);
      spendPoints();
      stage = Stage::kSamples;
      return true;
    case Stage::kSamples:
      if (!passOver(work)) return false;
      stage = Stage::kGroups;
      return true;
    case Stage::kGroups:
      for (; groups_done < groups.size(); ++groups_done)
        if (!groups[groups_done]->finish(work)) return false;
      stage = Stage::kSyringe;
      return true;
    case Stage::kSyringe:
      if (!syringe->finish(work)) return false;
      events = syringe->take();
      findSyringe(events, facts);
      stage = Stage::kReferences;
      return true;
    case Stage::kReferences: {
      findNearest(X_WL, references, facts);
      const std::vector<std::string> layer_names = layerNames(profile);
      measures = measuresOf(facts, layer_names);
      spendPoints();
      applyRequirements(exercise, facts, layer_names, measures);
      stage = Stage::kDone;
      return true;
    }
    case Stage::kDone:
      return true;
  }
  return true;
}

GestureScore::GestureScore(const RecordedSamples& samples, double rate_hz, const pb::Profile& profile,
                           const Pose& X_WL, const pb::Exercise* exercise,
                           std::span<const TipPath> references)
    : parts_(new Parts{samples, rate_hz, profile, X_WL, exercise, references}) {
  if (!(rate_hz >= kMinRateHz && rate_hz <= kMaxRateHz)) parts_->stage = Parts::Stage::kDone;
}

GestureScore::~GestureScore() = default;

bool GestureScore::step(StepWork& work) {
  while (parts_->stage != Parts::Stage::kDone) {
    if (work.isOver() || !parts_->goOn(work)) return false;
    if (!parts_->samples.fault().ok()) parts_->stage = Parts::Stage::kDone;
  }
  return true;
}

const std::vector<Measure>& GestureScore::measures() const {
  return parts_->measures;
}

const std::vector<pb::SyringeEvent>& GestureScore::events() const {
  return parts_->events;
}

const GestureScore::LatePaths& GestureScore::latePaths() const {
  return parts_->facts.late_paths;
}

std::vector<Measure> scoreGesture(const RecordedSamples& samples, double rate_hz, const pb::Profile& profile,
                                  const Pose& X_WL, const pb::Exercise* exercise,
                                  std::span<const TipPath> references) {
  GestureScore score(samples, rate_hz, profile, X_WL, exercise, references);
  StepWork all = StepWork::all();
  score.step(all);
  return score.measures();
}

}  // namespace needlelab
