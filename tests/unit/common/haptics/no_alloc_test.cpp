// The haptic tick and the gate do not use the heap.
#include "tests/support/realtime/no_alloc.h"

#include <gtest/gtest.h>

#include <vector>

#include "common/haptics/gate/force_gate.h"
#include "tests/unit/common/haptics/runs.h"

namespace needlelab::test {
namespace {

TEST(NoAllocScope, seesNewAndDeleteAndMalloc) {
  std::uint64_t by_new = 0, by_malloc = 0, none = 0;
  {
    const NoAllocScope scope;
    none = scope.calls();
  }
  {
    const NoAllocScope scope;
    std::vector<int> grown(100);
    grown.resize(1000);
    by_new = scope.calls();
  }
  {
    const NoAllocScope scope;
    void* volatile block = std::malloc(64);
    std::free(block);
    by_malloc = scope.calls();
  }
  EXPECT_EQ(none, 0u);
  EXPECT_GE(by_new, 3u);
  EXPECT_EQ(by_malloc, 2u);
}

TEST(NoAlloc, stepNeverUsesTheHeap) {
  for (const LimbKind limb : kLimbKinds)
    for (const auto mode : {ClampingMode::kProportional, ClampingMode::kConservative}) {
      SceneSpec scene = withClamping(withLimb(allEffects(), limb), mode);
      scene.virtual_fixture.max_force_N = 0.5;  // so that u turns
      const auto model = std::make_unique<SceneModel>(compiled(scene, 1000));
      const auto state = std::make_unique<SimState>();
      const Motion motion = randomGesture(4, 1000, siteOf(limb));
      StepReport report;
      std::uint32_t seen = 0;
      std::uint64_t calls = 0;
      {
        const NoAllocScope scope;
        for (const auto& sample : motion) {
          step(*model, sample, *state, report);
          seen |= report.flags;
        }
        calls = scope.calls();
      }
      EXPECT_EQ(calls, 0u) << limbName(limb);
      EXPECT_TRUE(seen & kFlagEntry) << limbName(limb);
      EXPECT_TRUE(seen & kFlagTurn) << limbName(limb);
    }
}

TEST(NoAlloc, gateUsesNoHeapFaultsIncluded) {
  ForceGate gate(DeviceLimits{}, 1000);
  std::uint64_t calls = 0;
  bool faulted = false;
  {
    const NoAllocScope scope;
    for (int k = 0; k < 3000; ++k) {
      const bool jumped = k % 400 > 380;
      const bool good = gate.admit({{0, 0, jumped ? 1.0 : 1e-4 * (k % 2)}, {}}, k % 7 != 0, 0.1);
      gate.noteOutside(true);
      (void)gate.guard({{good ? 3.0 : 0.0, 0, 0}, {0, 0.1, 0}});
      faulted = faulted || gate.fault() != Fault::kNone;
      if (k % 400 == 399) gate.acknowledge();
    }
    calls = scope.calls();
  }
  EXPECT_EQ(calls, 0u);
  EXPECT_TRUE(faulted);
}

}  // namespace
}  // namespace needlelab::test
