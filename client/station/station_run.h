/// One lesson from its beginning to its end: what `runStation` is made of.
#pragma once

#include <csignal>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "net/spool_guard.h"
#include "net/uplink.h"
#include "station/black_box_writer.h"
#include "station/device_keeper.h"
#include "station/fault_watch.h"
#include "station/lesson.h"
#include "station/servo_loop.h"
#include "station/summary.h"

namespace needlelab {

/// Everything of one lesson, in the order in which it comes to be. Thread: main.
class StationRun {
 public:
  StationRun(const StationOptions& options, const sigset_t& stop_signals)
      : options_(options), signals_(stop_signals) {}

  /// Gives the program's exit code.
  int run();

 private:
  // station_begin.cpp: who and what
  Status openSpool();
  Status connect();
  Status getLesson();
  // station_device.cpp: with which device, and what of the lesson it can render
  Status chooseDevice();
  Status measureEffects();
  Status openDevice();
  Status openSession();
  // station_practise.cpp
  Status practise();
  void watch(DeviceKeeper& keeper, FaultPolicy on_fault);
  void reportToServer(const FaultWatch& faults);
  // station_conclude.cpp
  void drain();
  int conclude(const Status& stored);
  StationSummary summarise();

  const StationOptions& options_;
  const sigset_t& signals_;
  std::string station_ = options_.station;
  std::unique_ptr<Spool> spool_;
  std::unique_ptr<SpoolGuard> spool_guard_;
  SampleRing ring_;
  std::unique_ptr<Uplink> uplink_;
  StationLesson lesson_;
  std::vector<std::string> device_notes_;
  std::optional<EffectCosts> effect_costs_;
  std::unique_ptr<Device> device_;
  std::shared_ptr<SpoolSession> session_;
  std::unique_ptr<ServoLoop> loop_;
  std::unique_ptr<SpoolWriter> writer_;
  std::vector<RtStep> realtime_;
  BlackBoxCounts black_box_;
  std::uint64_t max_ticks_ = 0;
};

}  // namespace needlelab
