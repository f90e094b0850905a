#include <memory>
#include <string>

#include "client/effect_cost/tick_cost.h"
#include "client/station/run/loop/black_box.h"
#include "common/base/time/clock.h"
#include "tests/bench/realtime/figures.h"
#include "tests/support/scenes/scenes.h"

namespace needlelab::test {

void addEngine(Figures& figures) {
  const auto addTick = [&figures](const std::string& what, const SceneSpec& scene) {
    const SceneModel model = *compile(scene, 1000);
    const auto gesture = measuringGesture(scene, 1000);
    TickRun run(model, gesture);
    const Timing tick = timeBatches(2000, 64, [&] { run.tick(); });
    figures.push_back({"engine: tick " + what + " p50", "ns", tick.median_ns, Beside::kMedian});
    figures.push_back({"engine: tick " + what + " p99", "ns", tick.p99_ns, Beside::kP99});
  };
  addTick("without an effect", withEffects(paperSixLayers(), 0));
  addTick("in the paper's six layers", paperSixLayers());
  addTick("with all effects", allEffects());

  auto histogram = std::make_unique<LatencyHistogram>();
  std::int64_t ns = 20'000;
  const Timing add = timeFor(0.1, [&] {
    histogram->add(ns);
    ns = 1 + ns * 5 % 60'013;
  });
  figures.push_back({"station: a duration into a histogram p50", "ns", add.median_ns, Beside::kMedian});
  auto box = std::make_unique<BlackBox>(1000.0);
  BlackBoxTick noted;
  const Timing keeping = timeFor(0.1, [&] {
    ++noted.tick;
    box->next() = noted;
    box->commit();
  });
  figures.push_back({"station: a tick into the black box p50", "ns", keeping.median_ns, Beside::kMedian});
}

}  // namespace needlelab::test
