// The cost of FEM: a live step over mesh sizes and stations (p50, p99 and worst of single steps, over a
// stroke with tremor, holds and reversals, where whole needles stick and slip), beside one solve of the whole
// mesh, and the time before a lesson can start. A benchmark, not a test.
//   build/release/bin/needlelab_fem_bench
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <map>
#include <utility>

#include "common/fem/needle_mesh.h"
#include "common/haptics/models/fem_needle.h"
#include "common/haptics/models/like_for_like.h"
#include "tests/support/random.h"
#include "tests/support/scenes/scenes.h"

namespace {

using namespace needlelab;
using namespace needlelab::test;
using Clock = std::chrono::steady_clock;

// the six layers, stiff and rough enough that most of a 60 mm needle is in, sticking after each reversal
SceneSpec tissue() {
  SceneSpec scene = likeForLike(allEffects(), AxialModel::kFem);
  for (FemLayerSpec& layer : scene.fem.layers) layer = {100e3, 0.45, 30, 0.5};
  return scene;
}

// meshes take seconds: one for each pair of nodes and stations
const NeedleCompliance& meshOf(int nodes, int stations, FemNeedle& needle) {
  static std::map<std::pair<int, int>, SceneSpec> made;
  SceneSpec& scene = made[{nodes, stations}];
  if (!scene.fem.compliance) {
    scene = tissue();
    NeedleMeshOptions options;
    options.nodes = nodes;
    options.stations = stations;
    scene.fem.compliance = *precomputeCompliance(scene, options);
  }
  needle = compileNeedle(scene);
  return *scene.fem.compliance;
}

// 8 s at 1 kHz: in and out of the tissue by legs of random length, 10 Hz tremor of 50 µm on it
std::vector<double> stroke() {
  Random random(5);
  std::vector<double> depths;
  double from = 0;
  while (depths.size() < 8000) {
    const double to = random.in(0.002, 0.055);
    const int ticks = static_cast<int>(random.in(200, 900));
    for (int k = 1; k <= ticks; ++k) {
      const double t = static_cast<double>(k) / ticks;
      const double phase = static_cast<double>(depths.size() % 100) / 100;
      const double tremor = 50e-6 * (phase < 0.5 ? 4 * phase - 1 : 3 - 4 * phase);
      depths.push_back(std::max(1e-6, from + (to - from) * t * t * (3 - 2 * t) + tremor));
    }
    from = to;
  }
  return depths;
}

void liveStep(benchmark::State& state) {
  FemNeedle needle;
  const NeedleCompliance& mesh =
      meshOf(static_cast<int>(state.range(0)), static_cast<int>(state.range(1)), needle);
  const std::vector<double> depths = stroke();
  std::vector<double> ns;
  std::uint32_t most_solves = 0, unsettled = 0;
  for (auto _ : state) {
    NeedleState at{};
    for (const double depth : depths) {
      const auto before = Clock::now();
      NeedleForce force = stepNeedle(needle, {depth, depth, 1.0}, at);
      benchmark::DoNotOptimize(force);
      ns.push_back(std::chrono::duration<double, std::nano>(Clock::now() - before).count());
      most_solves = std::max(most_solves, at.solves);
    }
    unsettled = at.unsettled;
  }
  std::sort(ns.begin(), ns.end());
  const auto share = [&](double s) {
    return ns[static_cast<std::size_t>(s * static_cast<double>(ns.size() - 1))];
  };
  state.counters["nodes"] = mesh.nodes;
  state.counters["p50_ns"] = share(0.5);
  state.counters["p99_ns"] = share(0.99);
  state.counters["p99.9_ns"] = share(0.999);
  state.counters["max_ns"] = ns.back();
  state.counters["most_solves"] = most_solves;
  state.counters["unsettled"] = unsettled;
  state.counters["one_whole_solve_ms"] = 1e3 * mesh.one_solve_s;
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(depths.size()));
}
BENCHMARK(liveStep)
    ->ArgNames({"nodes", "stations"})
    ->Args({500, 60})
    ->Args({1000, 60})
    ->Args({3000, 60})
    ->Args({10'000, 60})
    ->Args({30'000, 60})
    ->Args({3000, 15})
    ->Args({3000, 30})
    ->Args({3000, 90})
    ->Args({3000, 128})
    ->Unit(benchmark::kMillisecond);

void beforeTheLesson(benchmark::State& state) {
  const SceneSpec scene = tissue();
  NeedleMeshOptions options;
  options.nodes = static_cast<int>(state.range(0));
  std::shared_ptr<const NeedleCompliance> mesh;
  for (auto _ : state) mesh = *precomputeCompliance(scene, options);
  state.counters["nodes"] = mesh->nodes;
  state.counters["assemble_s"] = mesh->assemble_s;
  state.counters["factor_s"] = mesh->factor_s;
  state.counters["solve_s"] = mesh->solve_s;
}
BENCHMARK(beforeTheLesson)
    ->ArgName("nodes")
    ->Arg(500)
    ->Arg(1000)
    ->Arg(3000)
    ->Arg(10'000)
    ->Arg(30'000)
    ->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
