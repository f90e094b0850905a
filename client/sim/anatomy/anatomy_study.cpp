#include "client/sim/anatomy/anatomy_study.h"

#include <ctime>

#include <algorithm>
#include <bit>
#include <cmath>
#include <optional>
#include <utility>

#include "client/device/hand/hand.h"
#include "common/anatomy/inner_point.h"
#include "common/haptics/body/body_engine.h"
#include "common/haptics/body/path_stack.h"
#include "common/haptics/engine.h"
#include "common/haptics/surface.h"
#include "common/profile/scene_of_profile.h"
#include "common/profile/volume.h"

namespace needlelab {
namespace {

constexpr double kReference_m = 0.02e-3;
constexpr double kAround_m = 0.02;    // places lie within this of a target
constexpr double kStart_m = 0.3;      // a path comes from here
constexpr double kShortest_m = 2e-3;  // within the patient
constexpr double kMatched_m = 3e-3;   // two boundaries are the same if they are nearer than this
constexpr double kSpeed_mps = 0.02;
constexpr double kRate_Hz = 1000;

Vec3 drawnInBox(HandRandom& random, Vec3 low, Vec3 high) {
  // one draw per statement: the order in which arguments are evaluated is unspecified
  const double x = low.x + (high.x - low.x) * random.uniform();
  const double y = low.y + (high.y - low.y) * random.uniform();
  const double z = low.z + (high.z - low.z) * random.uniform();
  return {x, y, z};
}

/// Where needles aim at: a box around each target, or one around all bounded parts.
struct Box {
  Vec3 low, high;
};

void widen(Box& box, Vec3 p) {
  box.low = {std::min(box.low.x, p.x), std::min(box.low.y, p.y), std::min(box.low.z, p.z)};
  box.high = {std::max(box.high.x, p.x), std::max(box.high.y, p.y), std::max(box.high.z, p.z)};
}

std::vector<Box> placesToAimAt(const Field& field, const pb::Profile& profile) {
  std::vector<Box> boxes;
  const Vec3 around{kAround_m, kAround_m, kAround_m};
  const FieldSpec spec = fieldSpecOf(profile.volume());
  for (const pb::Target& target : profile.targets()) {
    Vec3 center = vectorOf(target.center_m());
    if (target.has_structure() && !target.has_center_m()) {
      const auto named = std::ranges::find(spec.structures, target.structure(), &FieldStructure::id);
      const auto inner =
          innerPoint(spec, field, static_cast<StructureIndex>(named - spec.structures.begin()));
      if (!inner) continue;
      center = inner->at_m;
    }
    boxes.push_back({center - around, center + around});
  }
  if (!boxes.empty()) return boxes;
  Box all{{1e3, 1e3, 1e3}, {-1e3, -1e3, -1e3}};
  for (const FieldGroup& group : spec.groups) {
    for (const FieldPart& part : group.parts) {
      if (const auto* const capsule = std::get_if<CapsulePart>(&part.shape)) {
        widen(all, capsule->a_m);
        widen(all, capsule->b_m);
      } else if (const auto* const ellipsoid = std::get_if<EllipsoidPart>(&part.shape)) {
        widen(all, ellipsoid->center_m);
      } else if (const auto* const tube = std::get_if<TubePart>(&part.shape)) {
        for (const TubePart::Point& point : tube->points) widen(all, point.at_m);
      }
    }
  }
  if (all.low.x > all.high.x) all = {-around, around};
  return {all};
}

/// Every `step_m`, the structure from the whole field; a change is halved.
LayerStack fixedSteps(const Field& field, const AnatomyPath& path, double reach_m, double step_m,
                      double min_layer_m) {
  std::vector<LayerStack::Layer> raw;
  const auto structureAt = [&](double t_m) { return field.at(path.entry_m + path.axis * t_m).structure; };
  const auto isBone = [&](StructureIndex structure) { return field.structures()[structure].layer.is_bone; };
  LayerStack stack;
  stack.end_m = reach_m;
  double before_m = std::min(step_m, 1e-4);
  StructureIndex before = structureAt(before_m);
  if (before != kOutside) raw.push_back({before, 0});
  while (before != kOutside && before_m < reach_m && !isBone(before)) {
    const double next_m = std::min(before_m + step_m, reach_m);
    const StructureIndex next = structureAt(next_m);
    if (next == before) {
      before_m = next_m;
      continue;
    }
    double low_m = before_m, high_m = next_m;
    while (high_m - low_m > kBoundary_m) {
      const double middle_m = 0.5 * (low_m + high_m);
      (structureAt(middle_m) == before ? low_m : high_m) = middle_m;
    }
    before = structureAt(high_m);
    before_m = high_m;
    if (before == kOutside || isBone(before)) stack.end_m = high_m;
    if (before != kOutside) raw.push_back({before, high_m});
  }
  // slivers, as a march drops them, but over the whole list
  std::vector<LayerStack::Layer> kept;
  for (const LayerStack::Layer& layer : raw) {
    if (!kept.empty() && layer.top_m - kept.back().top_m < min_layer_m) {
      if (kept.size() == 1) {
        kept.back().structure = layer.structure;
        continue;
      }
      kept.pop_back();
      if (kept.back().structure == layer.structure) continue;
    }
    kept.push_back(layer);
  }
  stack.count = std::min(kept.size(), kMaxStackLayers);
  std::copy_n(kept.begin(), stack.count, stack.layers.begin());
  return stack;
}

/// The engine's cutting and friction along the needle in a straight insertion at a constant speed, one number
/// a tick; empty where bone begins at the skin. Errors: the engine's, of a structure's numbers.
Result<std::vector<double>> forcesOf(const Field& field, const LayerStack& stack, const AnatomyPath& path,
                                     const pb::Profile& profile) {
  SceneSpec scene;
  scene.needle_length_m = profile.needle().length_m();
  scene.limb = PlaneLimb{path.entry_m, -path.axis};
  scene.tracking_wall.stiffness_N_per_m = profile.tracking_wall().stiffness_n_per_m();
  scene.effects = bitOf(Effect::kCutting) | bitOf(Effect::kShaftFriction);
  for (std::size_t i = 0; i < stack.count; ++i) {
    const bool is_last = i + 1 == stack.count;
    const FieldStructure& structure = field.structures()[stack.layers[i].structure];
    if (structure.layer.is_bone) break;
    LayerSpec layer = structure.layer;
    layer.rejection_force_N = 0;
    layer.attracted_force_N = 0;
    layer.membrane.reset();
    layer.thickness_m = is_last ? 1 : stack.layers[i + 1].top_m - stack.layers[i].top_m;
    scene.layers.push_back(std::move(layer));
  }
  std::vector<double> forces;
  if (scene.layers.empty()) return forces;
  ASSIGN_OR_RETURN(const SceneModel model, compile(scene, kRate_Hz));
  SimState state;
  StepReport report;
  const double tick_m = kSpeed_mps / kRate_Hz;
  const double end_m = std::min(stack.end_m, profile.needle().length_m());
  // the needle's frame: +z along the axis
  const Vec3 z = path.axis;
  const double w = std::sqrt(std::max(0.0, 0.5 * (1 + z.z)));
  const Quat q = w > 1e-6 ? Quat{-z.y / (2 * w), z.x / (2 * w), 0, w} : Quat{1, 0, 0, 0};
  for (double t_m = -tick_m; t_m < end_m; t_m += tick_m) {
    step(model, TipSample{path.entry_m + path.axis * t_m, q}, state, report);
    if (t_m >= 0) forces.push_back(dot(report.wrench_W.force_N, path.axis));
  }
  return forces;
}

double percentile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  const auto at =
      std::min(values.size() - 1, static_cast<std::size_t>(share * static_cast<double>(values.size())));
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(at), values.end());
  return values[at];
}

double threadSeconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// Another thread's paths: what they take is not the tick's.
class PathsElsewhere final : public PathMaker {
 public:
  explicit PathsElsewhere(const SceneModel& body) : paths_(body) {}
  void ask(const PathAsk& ask) noexcept override {
    const double before_s = threadSeconds();
    paths_.ask(ask);
    spent_s += threadSeconds() - before_s;
  }
  bool take(PathStack*& made) noexcept override { return paths_.take(made); }
  void retire(PathStack* path) noexcept override {
    const double before_s = threadSeconds();
    paths_.retire(path);
    spent_s += threadSeconds() - before_s;
  }
  double spent_s = 0;

 private:
  PathsInPlace paths_;
};

/// The processor time of ticks with the cap on, in µs: pressed 10 mm into the skin at each entry, and slid
/// 10 mm aside, at 50 mm/s.
Result<std::vector<double>> palpationTimes(const pb::Profile& profile,
                                           const std::vector<AnatomyPath>& paths) {
  constexpr int kTicks = 200;
  constexpr double kTick_m = 5e-5;
  std::vector<double> times_us;
  ASSIGN_OR_RETURN(const SceneSpec scene, sceneSpecOf(profile));
  ASSIGN_OR_RETURN(const SceneModel model, compile(scene, kRate_Hz));
  if (!model.isLive(Effect::kPalpation)) return times_us;
  for (const AnatomyPath& path : paths) {
    PathsElsewhere elsewhere(model);
    SceneEngine engine(model, &elsewhere);
    engine.wantCap(true);
    const Vec3 out = surfaceNormal(scene.limb, path.entry_m, path.axis),
               aside = normalized(cross(out, std::fabs(out.x) < 0.9 ? Vec3{1, 0, 0} : Vec3{0, 1, 0}));
    StepReport report;
    for (int tick = -kTicks; tick <= 2 * kTicks; ++tick) {
      const Vec3 tip = path.entry_m - out * (kTick_m * std::min(tick, kTicks)) +
                       aside * (kTick_m * std::max(0, tick - kTicks));
      elsewhere.spent_s = 0;
      const double before_s = threadSeconds();
      engine.step({tip, {1, 0, 0, 0}}, report);
      if (engine.state().palpation.skin.touching)
        times_us.push_back(1e6 * (threadSeconds() - before_s - elsewhere.spent_s));
    }
  }
  return times_us;
}

/// Sums up a method's stacks against the reference's.
class Comparison {
 public:
  void boundaries(const LayerStack& reference, const LayerStack& found) {
    std::vector<bool> used(found.count);
    for (std::size_t i = 1; i < reference.count; ++i) {
      ++boundaries_;
      std::optional<std::size_t> best;
      double best_m = kMatched_m;
      for (std::size_t k = 1; k < found.count; ++k) {
        const double off_m = std::fabs(found.layers[k].top_m - reference.layers[i].top_m);
        if (used[k] || off_m >= best_m || found.layers[k].structure != reference.layers[i].structure ||
            found.layers[k - 1].structure != reference.layers[i - 1].structure)
          continue;
        best = k;
        best_m = off_m;
      }
      if (!best) {
        ++missed_;
        continue;
      }
      used[*best] = true;
      off_mm_.push_back(1e3 * best_m);
    }
    for (std::size_t k = 1; k < found.count; ++k) extra_ += used[k] ? 0 : 1;
  }

  void forces(const std::vector<double>& reference, const std::vector<double>& found) {
    const std::size_t ticks = std::min(reference.size(), found.size());
    double squares = 0;
    for (std::size_t i = 0; i < ticks; ++i) {
      const double off_N = found[i] - reference[i];
      squares += off_N * off_N;
      max_N_ = std::max(max_N_, std::fabs(off_N));
    }
    if (ticks == 0) return;
    squares_ += squares;
    ticks_ += ticks;
    path_rms_N_.push_back(std::sqrt(squares / static_cast<double>(ticks)));
  }

  void time(double seconds) { us_.push_back(1e6 * seconds); }

  [[nodiscard]] AnatomyRow row(const AnatomyMethod& method) const {
    const auto percent = [&](std::size_t count) {
      return 100.0 * static_cast<double>(count) / static_cast<double>(std::max<std::size_t>(1, boundaries_));
    };
    return {.method = method,
            .boundary_p50_mm = percentile(off_mm_, 0.5),
            .boundary_p99_mm = percentile(off_mm_, 0.99),
            .boundary_max_mm = percentile(off_mm_, 1),
            .missed_percent = percent(missed_),
            .extra_percent = percent(extra_),
            .force_rms_N = ticks_ == 0 ? 0 : std::sqrt(squares_ / static_cast<double>(ticks_)),
            .path_rms_p99_N = percentile(path_rms_N_, 0.99),
            .force_max_N = max_N_,
            .march_p50_us = percentile(us_, 0.5),
            .march_p99_us = percentile(us_, 0.99)};
  }

 private:
  std::size_t boundaries_ = 0, missed_ = 0, extra_ = 0, ticks_ = 0;
  double squares_ = 0, max_N_ = 0;
  std::vector<double> off_mm_, path_rms_N_, us_;
};

constexpr AnatomyMethod kMethods[] = {{AnatomySteps::kFixed, 2e-3},     {AnatomySteps::kFixed, 1e-3},
                                      {AnatomySteps::kFixed, 0.5e-3},   {AnatomySteps::kFixed, 0.25e-3},
                                      {AnatomySteps::kFixed, 0.1e-3},   {AnatomySteps::kSphere, 0.4e-3},
                                      {AnatomySteps::kSphere, 0.2e-3},  {AnatomySteps::kSphere, 0.1e-3},
                                      {AnatomySteps::kSphere, 0.05e-3}, {AnatomySteps::kEngine, 0.1e-3}};
constexpr AnatomyMethod kProduct{AnatomySteps::kSphere, 0.1e-3};

}  // namespace

std::vector<AnatomyPath> randomPaths(const Field& field, const pb::Profile& profile, std::size_t count,
                                     std::uint64_t seed) {
  const std::vector<Box> boxes = placesToAimAt(field, profile);
  HandRandom random(seed);
  std::vector<AnatomyPath> paths;
  for (std::size_t i = 0; paths.size() < count && i < 50 * count; ++i) {
    const Box& box = boxes[i % boxes.size()];
    const Vec3 aim = drawnInBox(random, box.low, box.high);
    const Vec3 way = drawnInBox(random, {-1, -1, -1}, {1, 1, 1});
    if (normSquared(way) > 1 || normSquared(way) < 1e-2) continue;  // uniform over directions
    const Vec3 axis = normalized(way);
    const std::optional<double> entry_m = findEntry(field, aim - axis * kStart_m, axis, kStart_m);
    if (!entry_m || kStart_m - *entry_m > profile.needle().length_m()) continue;
    const AnatomyPath path{aim - axis * (kStart_m - *entry_m), axis};
    if (march(field, path.entry_m, axis, {.reach_m = kShortest_m}).end_m < kShortest_m) continue;
    paths.push_back(path);
  }
  return paths;
}

/// As the engine asks in the tick after an entry, and the layers as a stack up to the first bone.
LayerStack engineStack(const SceneModel& body, const Field& field, const AnatomyPath& path, double reach_m) {
  const auto& limb = std::get<BodyLimb>(body.body_spec->limb);
  PathAsk ask;
  ask.insertion = 1;
  ask.p_tip_W_m = ask.p_entry_W_m = ask.point_W_m = limb.X_WL * path.entry_m;
  ask.axis_W = rotate(limb.X_WL.q, path.axis);
  ask.normal_W = rotate(limb.X_WL.q, limb.body->normal(path.entry_m));
  ask.slant = std::max(0.05, -dot(ask.normal_W, ask.axis_W));
  LayerStack stack;
  stack.end_m = reach_m;
  PathLayers found;
  if (!findPath(body, ask, found)) return stack;
  for (std::uint32_t i = 0; i < found.count; ++i) {
    const StructureIndex structure = found.layers[i].structure;
    const double top_m = found.layers[i].top_m / ask.slant;
    if (top_m >= reach_m) break;
    const bool is_bone = structure != kOutside && field.structures()[structure].layer.is_bone;
    if (structure != kOutside) stack.layers[stack.count++] = {structure, top_m};
    if (structure != kOutside && !is_bone) continue;
    stack.end = is_bone ? StackEnd::kBone : StackEnd::kExit;
    stack.end_m = top_m;
    break;
  }
  return stack;
}

LayerStack AnatomyMethod::stackOf(const SceneModel& body, const Field& field, const AnatomyPath& path,
                                  double reach_m, double min_layer_m) const {
  if (steps == AnatomySteps::kEngine) return engineStack(body, field, path, reach_m);
  if (steps == AnatomySteps::kFixed) return fixedSteps(field, path, reach_m, step_m, min_layer_m);
  return march(field, path.entry_m, path.axis,
               {.reach_m = reach_m, .min_step_m = step_m, .min_layer_m = min_layer_m});
}

AnatomySection anatomySection(const Field& field, const pb::Profile& profile, char normal) {
  const std::vector<Box> places = placesToAimAt(field, profile);
  Box all = places.front();
  for (const Box& box : places) {
    widen(all, box.low);
    widen(all, box.high);
  }
  const Vec3 middle = (all.low + all.high) * 0.5;
  AnatomySection section;
  section.across = normal == 'x' ? 'y' : 'x';
  section.up = normal == 'z' ? 'y' : 'z';
  section.columns = section.rows = 400;
  section.pixel_m = 0.35e-3;
  const auto of = [](Vec3 v, char axis) { return axis == 'x' ? v.x : axis == 'y' ? v.y : v.z; };
  const double half_m = 0.5 * section.pixel_m * static_cast<double>(section.columns);
  section.at_m = of(middle, normal);
  section.left_m = of(middle, section.across) - half_m;
  section.bottom_m = of(middle, section.up) - half_m;
  section.pixels.reserve(section.columns * section.rows);
  for (std::size_t row = 0; row < section.rows; ++row) {
    for (std::size_t column = 0; column < section.columns; ++column) {
      const double across_m = section.left_m + (static_cast<double>(column) + 0.5) * section.pixel_m;
      const double up_m = section.bottom_m + (static_cast<double>(row) + 0.5) * section.pixel_m;
      Vec3 p;
      for (const auto& [axis, value_m] :
           {std::pair{normal, section.at_m}, {section.across, across_m}, {section.up, up_m}})
        (axis == 'x' ? p.x : axis == 'y' ? p.y : p.z) = value_m;
      section.pixels.push_back(field.at(p).structure);
    }
  }
  return section;
}

Result<AnatomyReport> anatomyStudy(const pb::Profile& profile, const AnatomyStudyOptions& options,
                                   const std::function<void(double)>& progress) {
  if (!profile.has_volume())
    return Error{ErrorCode::kInvalidInput, "volume: is missing: the study needs a profile with a volume"};
  ASSIGN_OR_RETURN(const Field field, fieldOf(profile.volume()));
  const std::vector<AnatomyPath> paths = randomPaths(field, profile, options.paths, options.seed);
  if (paths.size() < options.paths)
    return Error{ErrorCode::kInvalidInput,
                 "volume: only " + std::to_string(paths.size()) + " of " + std::to_string(options.paths) +
                     " random needle paths enter the skin and reach a target or a part"};
  ASSIGN_OR_RETURN(const SceneSpec scene, sceneSpecOf(profile));
  ASSIGN_OR_RETURN(const SceneModel body, compile(scene, kRate_Hz));
  const double reach_m = profile.needle().length_m();
  const double diameter_m = needleOf(profile.needle()).outer_diameter_m;
  const double min_layer_m = diameter_m > 0 ? diameter_m / 2 : MarchOptions{}.min_layer_m;

  AnatomyReport report;
  report.profile = profile.id();
  report.paths = paths.size();
  report.numbers = field.numbers();
  std::vector<Comparison> comparisons(std::size(kMethods));
  std::uint64_t hash = 0xCBF29CE484222325;
  for (std::size_t i = 0; i < paths.size(); ++i) {
    const LayerStack reference = fixedSteps(field, paths[i], reach_m, kReference_m, min_layer_m);
    ASSIGN_OR_RETURN(const std::vector<double> reference_N, forcesOf(field, reference, paths[i], profile));
    report.layers_per_path += static_cast<double>(reference.count) / static_cast<double>(paths.size());
    for (std::size_t k = 0; k < std::size(kMethods); ++k) {
      const double before_s = threadSeconds();
      const LayerStack stack = kMethods[k].stackOf(body, field, paths[i], reach_m, min_layer_m);
      comparisons[k].time(threadSeconds() - before_s);
      comparisons[k].boundaries(reference, stack);
      ASSIGN_OR_RETURN(const std::vector<double> forces_N, forcesOf(field, stack, paths[i], profile));
      comparisons[k].forces(reference_N, forces_N);
      if (kMethods[k] != kProduct) continue;
      for (std::size_t layer = 0; layer < stack.count; ++layer)
        for (const std::uint64_t word : {std::uint64_t{stack.layers[layer].structure},
                                         std::bit_cast<std::uint64_t>(stack.layers[layer].top_m)})
          hash = (hash ^ word) * 0x100000001B3;
    }
    progress(static_cast<double>(i + 1) / static_cast<double>(paths.size()));
  }
  report.hash = hash;
  ASSIGN_OR_RETURN(const std::vector<double> palpation_us, palpationTimes(profile, paths));
  report.palpation_p50_us = percentile(palpation_us, 0.5);
  report.palpation_p99_us = percentile(palpation_us, 0.99);
  for (std::size_t k = 0; k < std::size(kMethods); ++k)
    report.rows.push_back(comparisons[k].row(kMethods[k]));
  return report;
}

}  // namespace needlelab
