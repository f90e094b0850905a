/// The exercises that travel with the program: the bodies of db/samples/volumes. They are for a computer
/// without a server.
#pragma once

#include <string>
#include <vector>

#include "client/station/run/io/options.h"
#include "client/station/run/lesson/curriculum.h"
#include "client/station/run/lesson/list_exercises.h"
#include "common/base/result.h"
#include "needlelab/control.pb.h"

namespace needlelab {

/// Returns whether this station offers the built-in exercises: it has neither a server nor a profile on the
/// command line, and its spool has no lesson and no list from a server. Thread: any.
bool practisesAlone(const StationOptions& options);
/// Returns the built-in course, as a server lists it: open to all, without trainees and standings. Thread:
/// any.
const Curriculum& builtInCurriculum();
/// Returns its exercises in the order of the course, for a list. Thread: any.
std::vector<ListedExercise> builtInExercises();
/// Returns a built-in exercise and its profile, as a server sends them; profile revision 0. Errors:
/// kNotFound. Thread: any.
Result<pb::Lesson> builtInLesson(const std::string& exercise_id);

}  // namespace needlelab
