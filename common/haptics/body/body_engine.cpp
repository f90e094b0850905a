#include "common/haptics/body/body_engine.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <utility>

#include "common/haptics/body/bones_in_body.h"
#include "common/haptics/body/next_path.h"
#include "common/haptics/effects/trajectory.h"
#include "common/haptics/surface.h"
#include "common/haptics/tick.h"
#include "common/haptics/touch/palpation.h"

namespace needlelab {
namespace {

/// Whether to ask for a path is looked at when the tip has moved by this, and outside at each mark.
constexpr double kMoved_m = 3e-4;
/// Outside it is asked for when the tip has also moved by this share of its height, or the needle has turned
/// by this sine.
constexpr double kMovedShare = 0.1, kTurnedOutside = 5e-3;
/// Inside a path is asked for when u has turned by this sine, P0 has moved, the tip's depth beside its line
/// has changed, or the tip has gone on by this share of the ball about it.
constexpr double kTurned = 2e-4, kEntryMoved_m = 1e-5, kAside_m = 2e-5, kOfBall = 0.25;
/// The tip is marked this often, in times of a path, to know how it moves.
constexpr std::uint64_t kMarkPaths = 4;
/// A place is expected no farther from the tip than this.
constexpr double kMostAhead_m = 0.02;
/// Bones are asked often so far around the place where the tip is expected, and on its way there.
constexpr double kBall_m = 0.010;
/// With the cap on a piece is right so far around tip and proxy, and where they are expected; a new one is
/// asked for when the tip has gone on by this.
constexpr double kAround_m = 0.006, kOnAround_m = 0.003;
bool turned(Vec3 a, Vec3 b, double sine) {
  return normSquared(a - b) > sine * sine;
}

}  // namespace

void PathsInPlace::ask(const PathAsk& ask) noexcept {
  PathLayers path;
  made_ = findPath(body_, ask, path) ? compilePath(body_, path) : nullptr;
}
bool PathsInPlace::take(PathStack*& made) noexcept {
  made = made_.release();
  return true;
}
void PathsInPlace::retire(PathStack* path) noexcept {
  delete path;
}
void PathsInPlace::continueFrom(const PathsInPlace& other) {
  made_ = other.made_ ? std::make_unique<PathStack>(*other.made_) : nullptr;
}

struct SceneEngine::InBody {
  const SceneModel& body;
  std::optional<PathsInPlace> in_place;
  PathMaker* paths;
  PathStack* now = nullptr;
  std::uint64_t paths_used = 0;
  std::uint64_t tick = 0;  // of the engine: steps since the start
  std::uint64_t next_mark = 0;
  // the tick of the next mark, or of a path that is due before it; with the cap on, the next tick
  std::uint64_t next_event = 0;
  std::uint64_t path_ticks;
  bool asked = false;
  std::uint64_t due = 0;  // the tick that uses the path asked for
  PathAsk ask;            // the last one
  Vec3 asked_at_W_m;      // the tip when it was asked
  Vec3 looked_at_W_m;     // the tip when it was last looked whether to ask
  // of the state, when its insertion, u and P0 were last found near enough to those of the ask
  std::uint32_t line_changes = 0;
  // the tip at the last two marks
  struct Mark {
    Vec3 p_W_m;
    std::uint64_t tick = 0;
  } mark, mark_before;
  // a reader's paths: the next one, and the insertion whose paths are given (0: none)
  std::unique_ptr<PathStack> given;
  std::uint64_t given_insertion = 0;
  bool given_now = false;  // for the next tick, outside

  InBody(const SceneModel& model, PathMaker* maker)
      : body(model), paths(maker), path_ticks(pathTicks(model.rate_hz)) {
    if (paths == nullptr) paths = &in_place.emplace(model);
  }
  ~InBody() {
    if (PathStack* made = nullptr; asked && paths->take(made) && made != nullptr) paths->retire(made);
    if (now != nullptr) paths->retire(now);
  }
  InBody(const InBody&) = delete;
  InBody& operator=(const InBody&) = delete;

  /// Uses a path from this tick on, or retires it. Returns whether it uses it.
  bool use(PathStack* made, std::uint64_t insertion, std::uint32_t& flags, SimState& state) noexcept;
  void replace(PathStack* next, std::uint32_t& flags, SimState& state) noexcept;
  /// A reader that begins while the cap presses has a piece of the body at once.
  void beginCapped(const TipSample& sample, SimState& state);
  /// The path for this tick, if one is due or was given for it. True if it is used.
  bool usePath(const StoredTick* stored, std::uint32_t& flags, SimState& state) noexcept;
  void useOutside(PathStack& next, std::uint32_t& flags, SimState& state) const noexcept;
  [[nodiscard]] bool looks(const TipSample& sample) const noexcept {
    return !(normSquared(sample.p_WT_m - looked_at_W_m) <= kMoved_m * kMoved_m);
  }
  [[nodiscard]] bool wantsInside(const TipSample& sample, const SimState& state) noexcept;
  [[nodiscard]] bool wantsOutside(const TipSample& sample, const SimState& state) noexcept;
  void askFor(const TipSample& sample, const SimState& state) noexcept;
};

// the skin is a new plane: both ticks of an entry are tested with it. Where the last tip would be in the
// tissue, the plane gives way to it. A tip that was outside of it when the path was asked for has been
// outside
void SceneEngine::InBody::useOutside(PathStack& next, std::uint32_t& flags, SimState& state) const noexcept {
  SceneModel& model = next.model;
  state.layer = 0;
  if (!state.has_prev || state.palpation.capped) return;
  state.outside_once = state.outside_once || !(depthIn(model, asked_at_W_m) > 0.0);
  double depth_m = depthIn(model, state.p_prev_W_m);
  if (depth_m > 0.0 && state.outside_once) {
    if (depth_m > model.layers[0].bottom_m) flags |= kFlagSkipped;
    model.plane_point_m = model.plane_point_m - model.plane_normal * depth_m;
    model.limb = PlaneLimb{model.plane_point_m, model.plane_normal};
    depth_m = 0.0;
  }
  state.depth_prev_m = depth_m;
}

void SceneEngine::InBody::replace(PathStack* next, std::uint32_t& flags, SimState& state) noexcept {
  flags |= kFlagNewPath;
  if (state.inside)
    flags |= continueOn(*now, *next, state);
  else
    useOutside(*next, flags, state);
  if (now != nullptr) paths->retire(now);
  now = next;
  ++paths_used;
}

bool SceneEngine::InBody::use(PathStack* made, std::uint64_t insertion, std::uint32_t& flags,
                              SimState& state) noexcept {
  if (made == nullptr) return false;
  const bool fits =
      insertion == (state.inside ? state.insertions : 0) && !(state.inside && alike(*now, *made));
  if (!fits) {
    paths->retire(made);
    return false;
  }
  replace(made, flags, state);
  return true;
}

// a stored tick decides which path begins in it. A reader that joined later asks for its own paths in other
// ticks than the station; inside it uses these only as long as no path of the insertion was given
bool SceneEngine::InBody::usePath(const StoredTick* stored, std::uint32_t& flags, SimState& state) noexcept {
  const bool told = stored != nullptr && (stored->flags & kFlagNewPath) != 0 && given != nullptr;
  PathStack* made = nullptr;
  if (asked && tick == due) {
    const bool late = stored != nullptr && (stored->flags & kFlagKeptPath) != 0;
    if (late || !paths->take(made)) {
      flags = kFlagKeptPath;
      due += path_ticks;
    } else {
      asked = false;
    }
  }
  const bool given_before = std::exchange(given_now, false);
  const bool has_own = !told && !given_before &&
                       !(stored != nullptr && state.inside && given_insertion == state.insertions &&
                         (stored->flags & kFlagNewPath) == 0);
  if (made != nullptr && has_own) return use(made, ask.insertion, flags, state);
  if (made != nullptr) paths->retire(made);
  // an entry's path was used before its tick
  if (given_before && stored != nullptr) flags |= stored->flags & kFlagNewPath;
  if (!told || (state.inside && now == nullptr)) return false;
  replace(given.release(), flags, state);
  return true;
}

void SceneEngine::InBody::beginCapped(const TipSample& sample, SimState& state) {
  PathLayers path;
  std::uint32_t flags = 0;
  PathAsk first;
  first.capped = true;
  first.p_tip_W_m = first.point_W_m = sample.p_WT_m;
  first.ball_radius_m = kAround_m;
  first.axis_W = unitAxis(sample);
  if (findPath(body, first, path))
    if (auto made = compilePath(body, path)) replace(made.release(), flags, state);
}

// how much deeper the tip is than the place of the line beside it
double asideOf(const TipSample& sample, const SimState& state) {
  return state.depth_prev_m - dot(state.u_W, sample.p_WT_m - state.p_entry_W_m) * state.slant;
}

bool SceneEngine::InBody::wantsInside(const TipSample& sample, const SimState& state) noexcept {
  const double far_m = kOfBall * ask.ball_radius_m;
  if (ask.insertion != state.insertions || turned(state.u_W, ask.axis_W, kTurned) ||
      normSquared(state.p_entry_W_m - ask.p_entry_W_m) > kEntryMoved_m * kEntryMoved_m ||
      std::fabs(asideOf(sample, state) - ask.aside_m) > kAside_m ||
      normSquared(sample.p_WT_m - asked_at_W_m) > far_m * far_m)
    return true;
  line_changes = state.line_changes;
  looked_at_W_m = sample.p_WT_m;
  return false;
}

bool SceneEngine::InBody::wantsOutside(const TipSample& sample, const SimState& state) noexcept {
  assert(!state.inside);
  looked_at_W_m = sample.p_WT_m;
  if (now == nullptr || ask.insertion != 0 || ask.capped != state.palpation.capped) return true;
  if (ask.capped) return normSquared(sample.p_WT_m - asked_at_W_m) > kOnAround_m * kOnAround_m;
  const double enough_m = std::max(kMoved_m, kMovedShare * std::fabs(state.depth_prev_m));
  if (normSquared(sample.p_WT_m - asked_at_W_m) > enough_m * enough_m) return true;
  // making a vector a unit vector at most doubles its distance from another: mostly no root is needed
  constexpr double kSurely = 0.499 * kTurnedOutside;
  return !(normSquared(zAxis(sample.q_WT) - ask.axis_W) < kSurely * kSurely) &&
         turned(unitAxis(sample), ask.axis_W, kTurnedOutside);
}

void SceneEngine::InBody::askFor(const TipSample& sample, const SimState& state) noexcept {
  const auto past = static_cast<double>(tick - mark_before.tick);
  const Vec3 moved = past > 0 ? (sample.p_WT_m - mark_before.p_W_m) * (1.0 / past) : Vec3{};  // per tick
  Vec3 ahead = moved * (1.5 * static_cast<double>(path_ticks));
  if (normSquared(ahead) > kMostAhead_m * kMostAhead_m) ahead = ahead * (kMostAhead_m / norm(ahead));
  ask.tick = tick;
  ask.insertion = state.inside ? state.insertions : 0;
  ask.capped = state.palpation.capped;
  if (ask.capped) {
    const Vec3 to_bone = state.palpation.bone.stretch_W_m * 0.5;
    ask.p_tip_W_m = sample.p_WT_m + to_bone + ahead;
    ask.ball_radius_m = kAround_m + norm(to_bone) + norm(ahead);
    ask.point_W_m = sample.p_WT_m + state.palpation.skin.stretch_W_m + ahead;
  } else {
    ask.p_tip_W_m = state.bone.touching ? state.bone.p_proxy_W_m : sample.p_WT_m + ahead;
    ask.ball_radius_m = kBall_m + norm(ask.p_tip_W_m - sample.p_WT_m);
  }
  asked_at_W_m = looked_at_W_m = sample.p_WT_m;
  if (state.inside) {
    ask.axis_W = state.u_W;
    ask.p_entry_W_m = state.p_entry_W_m;
    line_changes = state.line_changes;
    ask.slant = state.slant;
    ask.depth_m = std::max(0.0, state.depth_prev_m);
    ask.aside_m = asideOf(sample, state);
    ask.point_W_m = now->model.plane_point_m;
    ask.normal_W = now->model.plane_normal;
  } else {
    ask.axis_W = unitAxis(sample);
  }
  asked = true;
  due = tick + path_ticks;
  next_event = std::min(next_event, due);
  paths->ask(ask);
}

// ---- the engine ----

SceneEngine::SceneEngine(const SceneModel& model, PathMaker* paths)
    : model_(&model),
      scene_(&model),
      is_plain_(!model.body_spec && !model.isLive(Effect::kPalpation)),
      body_(model.body_spec ? std::make_unique<InBody>(model, paths) : nullptr) {}
SceneEngine::SceneEngine(SceneEngine&&) noexcept = default;
SceneEngine& SceneEngine::operator=(SceneEngine&&) noexcept = default;
SceneEngine::~SceneEngine() = default;

const PathLayers* SceneEngine::path() const noexcept {
  return body_ && body_->now != nullptr ? &body_->now->path : nullptr;
}

std::uint64_t SceneEngine::pathsUsed() const noexcept {
  return body_ ? body_->paths_used : 0;
}

void SceneEngine::restart() {
  state_ = {};
  wants_cap_ = false;
  if (!body_) return;
  assert(body_->in_place && "another thread's answer would come to the new engine");
  const SceneModel& body = body_->body;
  body_ = std::make_unique<InBody>(body, nullptr);
  model_ = &body;
}

bool SceneEngine::givePath(const PathLayers& path, bool enters) {
  if (!body_ || path.count == 0) return false;
  const std::size_t structures = body_->body.body_spec->layers.size();
  for (std::uint32_t i = 0; i < path.count; ++i)
    if (path.layers[i].structure >= structures && (path.layers[i].structure != kOutside || i == 0))
      return false;
  body_->given = compilePath(body_->body, path);
  if (!body_->given) return false;
  if (enters) state_.inside = state_.in_limb = state_.bone.touching = false;
  body_->given_insertion = state_.insertions + (state_.inside ? 0 : 1);
  if (state_.inside) return true;
  std::uint32_t flags = 0;
  body_->replace(body_->given.release(), flags, state_);
  body_->given_now = true;
  model_ = &body_->now->model;
  return true;
}

PathLayers SceneEngine::pathInUse() const {
  assert(path() != nullptr);
  PathLayers path = *this->path();
  path.point_W_m = model_->plane_point_m;
  return path;
}

void SceneEngine::continueFrom(const SceneEngine& other) {
  assert(!body_ == !other.body_ && is_plain_ == other.is_plain_);
  if (!body_) {
    state_ = other.state_;
    wants_cap_ = other.wants_cap_;
    return;
  }
  restart();
  wants_cap_ = other.wants_cap_;
  assert(&body_->body == &other.body_->body && other.body_->in_place);
  state_ = other.state_;
  InBody& to = *body_;
  const InBody& from = *other.body_;
  if (from.now != nullptr) to.now = std::make_unique<PathStack>(*from.now).release();
  if (from.given) to.given = std::make_unique<PathStack>(*from.given);
  to.paths_used = from.paths_used;
  to.given_insertion = from.given_insertion;
  to.given_now = from.given_now;
  to.tick = from.tick;
  to.asked = from.asked;
  to.due = from.due;
  to.ask = from.ask;
  to.asked_at_W_m = from.asked_at_W_m;
  to.looked_at_W_m = from.looked_at_W_m;
  to.line_changes = from.line_changes;
  to.next_mark = from.next_mark;
  to.next_event = from.next_event;
  to.mark = from.mark;
  to.mark_before = from.mark_before;
  to.in_place->continueFrom(*from.in_place);
  model_ = to.now != nullptr ? &to.now->model : &to.body;
}

// the needle's own tick, or with its cap on palpation
void SceneEngine::stepOnModel(const TipSample& sample, const StoredTick* stored, bool as_stored,
                              StepReport& report) noexcept {
  if (scene_->isLive(Effect::kPalpation)) {
    if (stored != nullptr && (stored->flags & kFlagNotStepped) == 0) {
      wants_cap_ = (stored->flags & kFlagCapped) != 0;
      const bool clear = (stored->flags & kFlagStartedInside) == 0;
      if (wants_cap_ != isCapped() || (wants_cap_ && !clear && state_.palpation.clear))
        setCap(wants_cap_, clear, state_);
    }
    if (changeCap(*scene_, model_->around, wants_cap_, sample, state_))
      return palpate(*scene_, model_->around, sample, state_, report);
  }
  if (as_stored)
    static_cast<void>(needlelab::stepAsStored(*model_, sample, *stored, state_, report));
  else
    needlelab::step(*model_, sample, state_, report);
}

// In every tick (tests/instructions counts what it costs): most have no bone and ask for no path.
[[gnu::always_inline]] inline void SceneEngine::afterStep(const TipSample& sample,
                                                          StepReport& report) noexcept {
  InBody& body = *body_;
  if (report.layer < 0) {
    if ((report.flags & kFlagExit) != 0 || body.looks(sample)) return afterStepOutside(sample, report);
    ++body.tick;
    return;
  }
  report.layer = body.now->reported[static_cast<std::size_t>(report.layer)];
  if (report.layer == kTouchedBone ||
      (!body.asked && (body.looks(sample) || state_.line_changes != body.line_changes))) [[unlikely]]
    return afterStepInside(sample, report);
  ++body.tick;
}

[[gnu::noinline]] void SceneEngine::afterStepInside(const TipSample& sample, StepReport& report) noexcept {
  if (report.layer == kTouchedBone) report.layer = touchedBone(*model_, state_);
  if (!body_->asked && body_->wantsInside(sample, state_)) body_->askFor(sample, state_);
  ++body_->tick;
}

// a sample that is not finite looks as if it had moved
[[gnu::noinline]] void SceneEngine::afterStepOutside(const TipSample& sample,
                                                     const StepReport& report) noexcept {
  if ((report.flags & kFlagNotStepped) != 0) return;
  if (!body_->asked && body_->wantsOutside(sample, state_)) body_->askFor(sample, state_);
  ++body_->tick;
}

void SceneEngine::stepOther(const TipSample& sample, StepReport& report) noexcept {
  if (!body_) return stepOnModel(sample, nullptr, false, report);
  if (body_->tick == body_->next_event) [[unlikely]]
    return stepAtEvent(sample, nullptr, report);
  needlelab::step(*model_, sample, state_, report);
  afterStep(sample, report);
}

void SceneEngine::wantCap(bool on) noexcept {
  wants_cap_ = on;
  if (body_) body_->next_event = body_->tick;
}

void SceneEngine::stepAtEvent(const TipSample& sample, const StoredTick* stored, StepReport& report,
                              bool as_stored) noexcept {
  as_stored = as_stored && stored != nullptr;
  if (!body_) return stepOnModel(sample, stored, as_stored, report);
  InBody& body = *body_;
  std::uint32_t flags = 0;
  if (stored != nullptr || (body.asked && body.tick == body.due)) {
    static_cast<void>(body.usePath(stored, flags, state_));
    const bool presses =
        stored != nullptr && (stored->flags & kFlagCapped) != 0 && stored->force_W_N != Vec3{};
    if (presses && body.now == nullptr && isFinite(sample)) body.beginCapped(sample, state_);
    if (body.now != nullptr) model_ = &body.now->model;
  }
  stepOnModel(sample, stored, as_stored, report);
  if ((report.flags & kFlagNotStepped) != 0) return;
  report.flags |= flags;
  if (body.tick == body.next_mark) {
    body.mark_before = body.tick == 0 ? InBody::Mark{sample.p_WT_m, 0} : body.mark;
    body.mark = {sample.p_WT_m, body.tick};
    if (!state_.inside) body.looked_at_W_m.x = std::numeric_limits<double>::infinity();
    body.next_mark += kMarkPaths * body.path_ticks;
  }
  body.next_event = body.asked ? std::min(body.due, body.next_mark) : body.next_mark;
  if (wants_cap_ || isCapped()) body.next_event = body.tick + 1;
  afterStep(sample, report);
}

void SceneEngine::stepOnPaths(const TipSample& sample, const StoredTick& stored, StepReport& report) {
  stepAtEvent(sample, &stored, report, false);
}

StoredDifference SceneEngine::stepAsStored(const TipSample& sample, const StoredTick& stored,
                                           StepReport& report) {
  if (is_plain_) return needlelab::stepAsStored(*model_, sample, stored, state_, report);
  // the stored structure, as the layer of the path that is nearest to the tip
  StoredTick on_path = stored;
  if (body_ && body_->now != nullptr && stored.layer >= 0) {
    const PathStack& now = *body_->now;
    const auto count = static_cast<std::int32_t>(now.model.layer_count);
    const auto here = static_cast<std::int32_t>(state_.layer);
    std::int32_t nearest = static_cast<std::int32_t>(kMaxLayers);
    for (std::int32_t i = 0; i < count; ++i) {
      if (now.reported[static_cast<std::size_t>(i)] != stored.layer) continue;
      if (nearest == static_cast<std::int32_t>(kMaxLayers) || std::abs(i - here) < std::abs(nearest - here))
        nearest = i;
    }
    on_path.layer = nearest;
  }
  stepAtEvent(sample, &on_path, report);
  return differenceFrom(stored, report);
}

}  // namespace needlelab
