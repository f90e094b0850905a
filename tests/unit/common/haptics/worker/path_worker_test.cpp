/// Paths from another thread are those made in place.
#include "common/haptics/worker/path_worker.h"

#include <gtest/gtest.h>

#include <limits>
#include <memory>

#include "common/haptics/scene_model.h"
#include "tests/support/anatomy/bodies.h"
#include "tests/support/patience.h"

namespace needlelab::test {
namespace {

std::unique_ptr<SceneModel> armModel() {
  auto model = compile(sceneIn(arm()), kRate_hz);
  EXPECT_TRUE(model.ok());
  return std::make_unique<SceneModel>(std::move(*model));
}

PathAsk askAbove(double y_m) {
  PathAsk ask;
  ask.p_tip_W_m = {0, y_m, 0.005};
  ask.axis_W = {0, 0, -1};
  return ask;
}

PathStack* waitFor(PathWorker& worker) {
  PathStack* made = nullptr;
  EXPECT_TRUE(eventually([&] { return worker.take(made); }));
  return made;
}

TEST(PathWorker, makesThePathsOfPathsInPlace) {
  const auto model = armModel();
  PathWorker worker(*model);
  PathsInPlace in_place(*model);
  for (int i = 0; i < 50; ++i) {
    const PathAsk ask = askAbove(-0.02 + 0.0008 * i);
    worker.ask(ask);
    in_place.ask(ask);
    PathStack *made = waitFor(worker), *wanted = nullptr;
    ASSERT_TRUE(in_place.take(wanted));
    ASSERT_TRUE(made != nullptr && wanted != nullptr);
    EXPECT_EQ(made->path.layers, wanted->path.layers);
    EXPECT_EQ(made->path.point_W_m, wanted->path.point_W_m);
    EXPECT_EQ(made->path.ball_W_m, wanted->path.ball_W_m);
    worker.retire(made);
    in_place.retire(wanted);
  }
}

TEST(PathWorker, answersWithNullForATipThatIsNowhere) {
  const auto model = armModel();
  PathWorker worker(*model);
  PathAsk ask = askAbove(0);
  ask.p_tip_W_m.x = std::numeric_limits<double>::quiet_NaN();
  worker.ask(ask);
  EXPECT_EQ(waitFor(worker), nullptr);
}

TEST(PathWorker, endsWithAQuestionOpen) {
  const auto model = armModel();
  for (int i = 0; i < 20; ++i) {
    PathWorker worker(*model);
    worker.ask(askAbove(0.001 * i));
  }
}

}  // namespace
}  // namespace needlelab::test
