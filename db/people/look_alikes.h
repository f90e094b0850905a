/// Names of what is not a person: ids and titles of groups, stations, profiles, courses and exercises. Those
/// with one nameKey() look alike, and a person is asked which is meant.
#pragma once

#include <map>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "db/store/connection.h"

namespace needlelab {

enum class Thing { kGroup, kStation, kProfile, kCourse, kExercise };

/// All names of one kind of thing. Thread: a single one.
class ThingNames {
 public:
  static Result<ThingNames> read(Connection& connection, Thing thing);

  /// Adds one that is not stored yet.
  void add(std::string_view id, std::string_view title);
  [[nodiscard]] bool has(std::string_view id) const { return titles_.contains(id); }
  /// "'Autumn-A' looks like the group 'autumn-a': use it? …", if `typed` is no id here but has the key of
  /// one, or of a title; else "".
  [[nodiscard]] std::string question(std::string_view typed) const;
  /// kNotFound, with question(): not for trainees, who may not learn of all things.
  [[nodiscard]] Status require(std::string_view id) const;
  /// kInvalidInput: `id` is new, and begins or ends with white space; kAlreadyExists: it looks like one that
  /// is there, or the new `title` has the key of another one's title, in another spelling.
  [[nodiscard]] Status checkNew(std::string_view id, std::string_view title) const;

 private:
  explicit ThingNames(Thing thing) : thing_(thing) {}

  Thing thing_;
  std::map<std::string, std::string, std::less<>> titles_;  ///< by id
  std::map<std::string, std::string, std::less<>> ids_;     ///< by the key of id or title; ids go first
};

/// ThingNames::checkNew(). Thread: as the connection; also for requireThing().
Status checkNewNames(Connection& connection, Thing thing, std::string_view id, std::string_view title);

/// For a filter that found nothing. kNotFound: `id` is not stored, but looks like one that is.
Status checkSpelling(Connection& connection, Thing thing, std::string_view id);

/// ThingNames::require().
Status requireThing(Connection& connection, Thing thing, std::string_view id);

}  // namespace needlelab
