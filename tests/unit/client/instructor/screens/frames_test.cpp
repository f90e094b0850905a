// Fifty tiles that update ten times a second: the work per frame stays bounded.
#include <imgui/imgui.h>

#include <algorithm>

#include "tests/unit/client/instructor/screens/window_lab.h"

namespace needlelab {
namespace {

using namespace test;

using Frames = WindowLab;

TEST_F(Frames, fiftyTilesFitIntoOneVertexList) {
  for (int i = 1; i <= 50; ++i) (void)server_.addStation("bench-" + std::to_string(i));
  lab_->logIn();
  ASSERT_TRUE(until([&] { return lab_->overview.size() == 50; }));
  int most = 0;
  for (int n = 0; n < 30; ++n) {
    // the status lines of fifty stations, every tenth of a second
    if (n % 3 == 0) {
      for (int i = 1; i <= 50; ++i) {
        pb::StationStatus status;
        status.set_station("bench-" + std::to_string(i));
        status.set_online(true);
        status.set_session_id(std::string(16, static_cast<char>(i)));
        status.set_trainee("trainee " + std::to_string(i));
        status.set_exercise_id("shoulder-bursa");
        status.set_phase(1);
        status.set_layer(2);
        status.set_insertion_m(0.001 * ((n + i) % 30));
        status.set_force_n(0.2 * ((n * 7 + i) % 40));
        lab_->overview.onStatus(status, lab_->now_s());
      }
    }
    frame();
    if (const ImDrawData* drawn = ImGui::GetDrawData()) most = std::max(most, drawn->TotalVtxCount);
  }
  EXPECT_GT(most, 50 * 4) << "the tiles are drawn";
  EXPECT_LT(most, 1 << 16);
}

}  // namespace
}  // namespace needlelab
