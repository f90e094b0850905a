// The cost of a haptic tick (goals: README.md): hot, in batches; cold, after a sleep and with flushed caches,
// an empty call beside it; and next to the literal transcription in the same run. A benchmark, not a test.
//   cmake --build build/release --target record_step_bench     writes tests/bench/results/<machine>/
//   build/release/bin/needlelab_step_bench                     only shows
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <thread>

#include "common/base/time/clock.h"
#include "common/fem/needle_mesh.h"
#include "common/haptics/models/like_for_like.h"
#include "tests/bench/step_loops.h"
#include "tests/bench/step_record.h"
#include "tests/support/reference/reference_engine.h"

namespace needlelab::test {
namespace {

constexpr std::size_t kBatch = 64;

// p50 and p99 over the batches as counters, the time of a tick as the benchmark's own
class Batches {
 public:
  explicit Batches(benchmark::State& state) : state_(state) {}
  void add(double total_ns, std::size_t ticks) {
    const double ns = std::max(0.0, total_ns - clockCost_ns());
    means_ns_.push_back(ns / static_cast<double>(ticks));
    state_.SetIterationTime(ns * 1e-9);
  }
  double p50(const char* prefix = "") {
    const Timing timing = timingOf(means_ns_, kBatch);
    state_.counters[std::string(prefix) + "p50_ns"] = timing.median_ns;
    state_.counters[std::string(prefix) + "p99_ns"] = timing.p99_ns;
    return timing.median_ns;
  }

 private:
  benchmark::State& state_;
  std::vector<double> means_ns_;
};

double batchOf(auto&& operation, std::size_t count) {
  const std::int64_t from_ns = steadyNowNs();
  for (std::size_t i = 0; i < count; ++i) operation();
  return static_cast<double>(steadyNowNs() - from_ns);
}

void hot(benchmark::State& state, const StepLoop& loop) {
  auto run = LoopRun::start(loop);
  if (!run.ok()) {
    state.SkipWithError(run.error().message.c_str());
    return;
  }
  Batches batches(state);
  for (auto _ : state)
    batches.add(batchOf(
                    [&] {
                      (*run)->tick();
                      keep((*run)->report());
                    },
                    kBatch),
                kBatch);
  batches.p50();
}

// the engine and the literal transcription on the same ticks, batch by batch in turn
void besideReference(benchmark::State& state) {
  const StepLoop loop = layersLoop(paperSixLayers());
  auto run = LoopRun::start(loop);
  if (!run.ok()) {
    state.SkipWithError(run.error().message.c_str());
    return;
  }
  ReferenceEngine reference(loop.scene, loop.rate_hz);
  for (const TipSample& sample : loop.way_in) reference.step(sample);
  Batches engine(state), literal(state);
  std::size_t next = 0;
  for (auto _ : state) {
    literal.add(batchOf(
                    [&] {
                      auto report = reference.step(loop.loop[next]);
                      keep(report);
                      if (++next == loop.loop.size()) next = 0;
                    },
                    kBatch),
                kBatch);
    engine.add(batchOf(
                   [&] {
                     (*run)->tick();
                     keep((*run)->report());
                   },
                   kBatch),
               kBatch);
  }
  state.counters["ratio"] = engine.p50() / literal.p50("reference_");
}

void emptyStep(const SceneModel&, const TipSample&, SimState&, StepReport&) noexcept {}

// one call at a time; its preparation is not timed
void cold(benchmark::State& state, bool sleeps, bool empty) {
  auto run = LoopRun::start(layersLoop(paperSixLayers()));
  if (!run.ok()) {
    state.SkipWithError(run.error().message.c_str());
    return;
  }
  static volatile StepFunction nothing = emptyStep;
  Batches calls(state);
  SimState no_state{};
  StepReport no_report;
  for (auto _ : state) {
    if (sleeps)
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    else
      (*run)->flush();
    if (empty) {
      const StepFunction call = nothing;
      calls.add(batchOf([&] { call((*run)->model(), (*run)->sample(), no_state, no_report); }, 1), 1);
    } else {
      calls.add(batchOf([&] { (*run)->tick(); }, 1), 1);
      keep((*run)->report());
    }
  }
  calls.p50();
}

// each axial model on the paper's six layers; FEM on a mesh of its default size
void axialModel(benchmark::State& state, AxialModel model) {
  SceneSpec scene = likeForLike(paperSixLayers(), model);
  if (auto status = addCompliance(scene); !status.ok()) {
    state.SkipWithError(status.error().message.c_str());
    return;
  }
  StepLoop loop = layersLoop(scene);
  loop.none_of &= ~kFlagForceCapped;  // an unlimited spring reaches the cap by design
  hot(state, loop);
}

void registerAll() {
  const auto tick = [](const std::string& name, const StepLoop& loop) {
    benchmark::RegisterBenchmark(name.c_str(), [loop](benchmark::State& state) {
      hot(state, loop);
    })->UseManualTime();
  };
  tick("hot/no_effect", layersLoop(withEffects(paperSixLayers(), 0)));
  tick("hot/wall_only",
       layersLoop(withEffects(paperSixLayers(), bitOf(Effect::kCutting) | bitOf(Effect::kAttracted))));
  tick("hot/paper_four", layersLoop(paperSixLayers()));
  tick("hot/paper_four_passive", layersLoop(withClamping(paperSixLayers(), ClampingMode::kConservative)));
  tick("hot/paper_four_10khz", layersLoop(paperSixLayers(), 10'000));
  tick("hot/all_six", layersLoop(allEffects()));
  tick("hot/with_torque", torqueLoop());
  tick("hot/in_a_turn", turnLoop());
  tick("hot/in_a_turn_held_by_the_cone", heldTurnLoop());
  tick("hot/pressed_against_the_cone", pressedLoop());
  benchmark::RegisterBenchmark("hot/paper_four_beside_reference", besideReference)->UseManualTime();
  for (std::size_t i = 0; i < kAxialModelCount; ++i)
    benchmark::RegisterBenchmark(
        ("model/" + std::string(kAxialModelNames[i])).c_str(),
        [i](benchmark::State& state) { axialModel(state, static_cast<AxialModel>(i)); })
        ->UseManualTime();
  for (const bool sleeps : {true, false})
    for (const bool empty : {true, false})
      benchmark::RegisterBenchmark((std::string("cold/") + (sleeps ? "after_1_ms_sleep" : "flushed") + "/" +
                                    (empty ? "empty_call" : "paper_four"))
                                       .c_str(),
                                   [=](benchmark::State& state) { cold(state, sleeps, empty); })
          ->UseManualTime()
          ->Iterations(sleeps ? 2000 : 4000);
}

}  // namespace
}  // namespace needlelab::test

int main(int argc, char** argv) {
  const auto record = needlelab::test::takeRecordOptions(argc, argv);
  needlelab::test::registerAll();
  return needlelab::test::runAndRecord(record, argc, argv);
}
