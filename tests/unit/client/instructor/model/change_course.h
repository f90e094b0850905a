/// Changes the courses of a server as a curriculum manager does.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <string>

#include "common/profile/profile.h"
#include "tests/unit/server/live/running_server.h"

namespace needlelab::test {

/// Stores a course. `manager` is a curriculum manager's connection. Fails the test if the server refuses it.
inline void putCourse(BlockingClient& manager, const pb::Curriculum& course) {
  pb::Request put;
  put.mutable_import_curriculum()->set_json(curriculumJson(course));
  const auto stored = manager.call(put);
  ASSERT_TRUE(stored.ok()) << stored.error().message;
}

/// Changes an exercise in the course that contains it. Fails the test if no course does.
inline void changeExercise(BlockingClient& manager, const std::string& exercise_id,
                           const std::function<void(pb::Exercise&)>& change) {
  pb::Request list;
  list.mutable_list_curricula();
  const auto courses = manager.call(list);
  ASSERT_TRUE(courses.ok()) << courses.error().message;
  bool changed = false;
  for (const auto& row : courses->curricula().curricula()) {
    pb::Request read;
    read.mutable_get_curriculum()->set_id(row.id());
    const auto course = manager.call(read);
    ASSERT_TRUE(course.ok()) << course.error().message;
    auto parsed = parseCurriculum(course->curriculum().json(), "course");
    ASSERT_TRUE(parsed.ok()) << parsed.error().message;
    auto& exercises = *parsed->mutable_exercises();
    const auto found = std::find_if(exercises.begin(), exercises.end(), [&](const pb::Exercise& exercise) {
      return exercise.id() == exercise_id;
    });
    if (found == exercises.end()) continue;
    change(*found);
    ASSERT_NO_FATAL_FAILURE(putCourse(manager, *parsed));
    changed = true;
  }
  ASSERT_TRUE(changed) << "no course has the exercise " << exercise_id;
}

}  // namespace needlelab::test
