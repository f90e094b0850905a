/// Runs the whole class on parallel stations, and reports the outcome as lines and as a table.
#pragma once

#include <csignal>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "tests/class/class_station.h"

namespace needlelab {

struct ClassOptions {
  std::string server, ca;
  std::vector<std::string> keys;      ///< one station each
  std::vector<std::string> trainees;  ///< NAME=SKILL
  std::vector<std::string> exercises;
  TimetableOptions timetable;
  std::string spool;  ///< a folder; below it one for each station
  std::string out;    ///< the table of sessions, CSV
};

/// Checks the numbers. Errors: kInvalidInput with option, value and range.
Status checkClass(const ClassOptions& options);

/// Runs all attempts; the trainees are assigned to the stations in turn. Shows progress on stderr if that is
/// a terminal, otherwise a line now and then. `stop_signals` end it. Errors: those of the first station that
/// failed; the recordings up to then are in its spool and at the server.
Result<std::vector<ClassSession>> runClass(const ClassOptions& options,
                                           const std::vector<ClassTrainee>& trainees,
                                           const sigset_t& stop_signals);

/// `session,trainee,exercise,attempt,skill,started_unix_s,samples,closed,passed,trouble`; passed 1, 0 or
/// empty.
std::string classTable(const std::vector<ClassSession>& sessions, const std::vector<ClassTrainee>& trainees,
                       const std::vector<std::string>& exercises);

/// For a person: by exercise, how many attempts passed of the less and of the more skilled half.
std::string classText(const std::vector<ClassSession>& sessions, const std::vector<ClassTrainee>& trainees,
                      const std::vector<std::string>& exercises);

}  // namespace needlelab
