#include "client/sim/tools/closed_loop.h"

#include <string>

namespace needlelab {
namespace {

Error faultOf(const ChainTick& tick) {
  return {ErrorCode::kFailed,
          "the gate took the force away at tick " + std::to_string(tick.tick) + ": " + faultText(tick.fault)};
}

}  // namespace

Result<std::vector<ChainTick>> runClosedLoop(const SceneModel& model, Device& device, const Pose& X_HT,
                                             std::uint64_t max_ticks) {
  if (Status status = device.open(model.rate_hz); !status.ok()) return status.error();
  HapticChain chain(model, device.info().limits, X_HT);
  std::vector<ChainTick> ticks;
  DeviceReading reading;
  while (ticks.size() < max_ticks) {
    const DeviceRead read = device.read(reading);
    if (read == DeviceRead::kFinished) break;
    device.write(chain.tick(reading, read == DeviceRead::kFresh, 1, 1.0, ticks.emplace_back()));
    if (ticks.back().fault != Fault::kNone) {
      device.close();
      return faultOf(ticks.back());
    }
  }
  device.close();
  return ticks;
}

}  // namespace needlelab
