#include "tests/bench/step_loops.h"

#include <cmath>
#include <numbers>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace needlelab::test {
namespace {

constexpr double kRateHz = 1000;

// a circle about the insertion line, the needle upright; its angular speed is below u's limit
Motion circle(double depth_m, double radius_m, double speed_mps) {
  const Site site = defaultSite();
  const auto ticks = static_cast<std::size_t>(2 * std::numbers::pi * radius_m / speed_mps * kRateHz);
  Motion motion;
  for (std::size_t k = 0; k < ticks; ++k) {
    const double angle = 2 * std::numbers::pi * static_cast<double>(k) / static_cast<double>(ticks);
    const Vec3 aside =
        site.across_1 * (radius_m * std::cos(angle)) + site.across_2 * (radius_m * std::sin(angle));
    motion.push_back({site.p_surface_m + site.inward * depth_m + aside, pointing(site.inward)});
  }
  return motion;
}

StepLoop circling(double depth_m, double radius_m) {
  constexpr double kSpeed_mps = 0.02;
  const Site site = defaultSite();
  StepLoop made;
  made.scene = paperSixLayers();
  made.scene.virtual_fixture.max_force_N = 0.3;
  MotionBuilder in(kRateHz, site.p_surface_m - site.inward * 0.005, site.inward);
  in.moveTo(site.p_surface_m + site.inward * depth_m, 1.0);
  in.moveTo(site.p_surface_m + site.inward * depth_m + site.across_1 * radius_m, 2.0);
  // two rounds to settle behind the tip
  made.loop = circle(depth_m, radius_m, kSpeed_mps);
  // the needle points to where its tip will be in 0.1 s, so that u may turn
  const Motion round = made.loop;
  for (std::size_t k = 0; k < round.size(); ++k)
    made.loop[k].q_WT = pointing(normalized(round[(k + 100) % round.size()].p_WT_m - site.p_surface_m));
  made.way_in = joined(joined(in.take(), made.loop), made.loop);
  return made;
}

}  // namespace

StepLoop layersLoop(const SceneSpec& scene, double rate_hz) {
  constexpr double kFrom_m = 0.006;
  const Site site = defaultSite();
  const auto at = [&](double depth_m) {
    return site.p_surface_m + site.inward * depth_m + site.across_1 * 0.0005;
  };
  StepLoop made;
  made.scene = scene;
  made.rate_hz = rate_hz;
  MotionBuilder in(rate_hz, site.p_surface_m - site.inward * 0.005, site.inward);
  // the axis stays straight, so u does not turn
  in.moveTo(site.p_surface_m + site.inward * kFrom_m, 0.5).moveTo(at(kFrom_m), 0.2);
  made.way_in = in.take();
  MotionBuilder loop(rate_hz, at(kFrom_m), site.inward);
  loop.moveTo(at(0.035), 1.5).hold(0.5).moveTo(at(kFrom_m), 1.5);
  made.loop = withTremor(loop.take(), rate_hz, 20e-6, 1);
  made.none_of = kFlagEntry | kFlagExit | kFlagTurn | kFlagTorque | kFlagForceCapped;
  return made;
}

StepLoop torqueLoop() {
  const Site site = defaultSite();
  const auto at = [&](double depth_m) { return site.p_surface_m + site.inward * depth_m; };
  const Vec3 tilt = tilted(site.inward, 1.2, site.across_1);
  StepLoop made;
  made.scene = paperSixLayers();
  MotionBuilder in(kRateHz, at(-0.005), site.inward);
  in.moveTo(at(0.030), 1.0).moveTo(at(0.030), tilt, 1.0);
  made.way_in = in.take();
  MotionBuilder loop(kRateHz, at(0.030), tilt);
  loop.moveTo(at(0.010), tilt, 1.0).hold(0.3).moveTo(at(0.030), tilt, 1.0);
  made.loop = withTremor(loop.take(), kRateHz, 20e-6, 1);
  made.all_of = kFlagTorque;
  made.none_of = kFlagTurn | kFlagExit;
  return made;
}

StepLoop turnLoop() {
  StepLoop made = circling(0.015, 0.006);
  made.all_of = kFlagTurn;
  return made;
}

StepLoop heldTurnLoop() {
  // at 30 mm the cone is 18° wide, the circle 25°
  StepLoop made = circling(0.030, 0.014);
  made.all_of = kFlagClampCapped;
  return made;
}

StepLoop pressedLoop() {
  StepLoop made = circling(0.030, 0.014);
  const TipSample still = made.way_in.back();
  MotionBuilder hold(kRateHz, still.p_WT_m, zAxis(still.q_WT));
  hold.hold(3.0);
  made.way_in = joined(std::move(made.way_in), hold.samples());
  made.loop = withTremor(hold.take(), kRateHz, 20e-6, 1);
  made.all_of = kFlagClampCapped;
  return made;
}

LoopRun::LoopRun(SceneModel model, const Motion& loop)
    : model_(std::move(model)), loop_(loop), state_(std::make_unique<SimState>()) {}

Result<std::unique_ptr<LoopRun>> LoopRun::start(const StepLoop& loop) {
  auto model = compile(loop.scene, loop.rate_hz);
  if (!model.ok()) return model.error();
  std::unique_ptr<LoopRun> run(new LoopRun(*model, loop.loop));
  for (const TipSample& sample : loop.way_in) step(run->model_, sample, *run->state_, run->report_);
  for (std::size_t k = 0; k < run->ticks(); ++k) {
    run->tick();
    const std::uint32_t flags = run->report().flags;
    if ((flags & loop.all_of) != loop.all_of || (flags & loop.none_of) != 0 || run->report().layer < 0)
      return Error{ErrorCode::kFailed, "tick " + std::to_string(k) + " of the loop has flags " +
                                           std::to_string(flags) + ", layer " +
                                           std::to_string(run->report().layer)};
  }
  return run;
}

void LoopRun::flush() const {
#if defined(__x86_64__)
  const auto out = [](const void* from, std::size_t bytes) {
    const char* at = static_cast<const char*>(from);
    for (std::size_t i = 0; i < bytes; i += 64) _mm_clflush(at + i);
  };
  out(&model_, sizeof model_);
  out(state_.get(), sizeof *state_);
  out(&report_, sizeof report_);
  out(&loop_[next_], sizeof(TipSample));
  _mm_mfence();
#endif
}

}  // namespace needlelab::test
