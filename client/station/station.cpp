#include "station/station.h"

#include "base/exit_code.h"
#include "station/say.h"
#include "station/station_run.h"

namespace needlelab {

int StationRun::run() {
  for (const auto step :
       {&StationRun::openSpool, &StationRun::connect, &StationRun::getLesson, &StationRun::chooseDevice,
        &StationRun::measureEffects, &StationRun::openDevice, &StationRun::openSession})
    if (const Status status = (this->*step)(); !status.ok()) {
      say(status.error().message);
      return exitCodeOf(status.error());
    }
  const Status stored = practise();
  drain();
  return conclude(stored);
}

int runStation(const StationOptions& options, const sigset_t& stop_signals) {
  if (!options.headless) say("there is no window yet; going on as with --headless");
  return StationRun(options, stop_signals).run();
}

}  // namespace needlelab
