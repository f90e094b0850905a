#include "client/station/run/station.h"

#include <utility>

#include "client/station/run/say.h"
#include "client/station/run/station_home.h"
#include "client/station/run/station_run.h"
#include "common/base/program.h"

namespace needlelab {

Status StationRun::prepare() {
  home_.requests().clear();
  const std::pair<const char*, Status (StationRun::*)()> steps[] = {
      {"fetching the exercise", &StationRun::getLesson},
      {"choosing the device", &StationRun::chooseDevice},
      {"measuring what the scene costs", &StationRun::measureEffects},
      {"opening the device", &StationRun::openDevice},
      {"beginning the recording", &StationRun::openSession},
  };
  for (const auto& [words, step] : steps) {
    // a person at the window who thought better of it; signals are heard where one waits
    if (home_.requests().takeStop()) return Error{ErrorCode::kFailed, "it was called off"};
    home_.audience().preparing(words);
    if (Status status = (this->*step)(); !status.ok()) return status;
  }
  announce();
  return {};
}

int runStation(const StationOptions& options, const sigset_t& stop_signals) {
  LessonAudience nobody;
  StationHome home(options, nobody);
  const auto failed = [](const Status& status) {
    say(status.error().message);
    return exitCodeOf(status.error());
  };
  if (const Status status = home.openSpool(); !status.ok()) return failed(status);
  if (const Status status = home.connect(); !status.ok()) return failed(status);
  StationRun run(home, options, stop_signals);
  if (const Status status = run.prepare(); !status.ok()) return failed(status);
  static_cast<void>(run.practise());  // what it says is in the outcome
  run.drain();
  const LessonOutcome outcome = run.outcome();
  home.close();
  home.guard().report();
  return run.report(outcome);
}

}  // namespace needlelab
