#include <fmt/core.h>
#include <optional>
#include <vector>

#include "common/base/text/text.h"
#include "common/profile/planned_line.h"
#include "common/profile/profile.h"
#include "common/profile/warnings.h"
#include "common/scoring/measures/measure_table.h"
#include "common/scoring/measures/measures.h"
#include "common/scoring/targets/reachable.h"
#include "db/people/look_alikes.h"
#include "db/people/person_refs.h"
#include "db/service/requests/handlers.h"
#include "db/service/requests/lessons/lesson_texts.h"
#include "db/service/requests/lessons/standing.h"
#include "db/teaching/documents.h"

namespace needlelab::handlers {
namespace {

pb::Reply profileReply(const StoredProfile& profile) {
  pb::Reply reply;
  auto* text = reply.mutable_profile();
  text->set_id(profile.id);
  text->set_revision(profile.revision);
  text->set_json(profile.json);
  text->set_created_unix_ns(profile.created_unix_ns);
  text->set_author(profile.author);
  return reply;
}

pb::Reply curriculumReply(const StoredCurriculum& curriculum) {
  pb::Reply reply;
  auto* text = reply.mutable_curriculum();
  text->set_id(curriculum.id);
  text->set_revision(curriculum.revision);
  text->set_json(curriculum.json);
  text->set_created_unix_ns(curriculum.created_unix_ns);
  text->set_author(curriculum.author);
  return reply;
}

/// An edit's base revision; nothing: any revision.
template <typename Call>
std::optional<std::uint32_t> baseOf(const Call& call) {
  return call.has_base_revision() ? std::optional(call.base_revision()) : std::nullopt;
}

/// The profile's targets must be reachable by a needle, and the exercise's plan must lie on its skin. `path`:
/// the exercise's, for messages.
Status exerciseFits(const StoredExercise& stored, const StoredProfile& profile, const std::string& path) {
  ASSIGN_OR_RETURN(const auto exercise, exerciseOf(stored));
  ASSIGN_OR_RETURN(const auto parsed, parseProfile(profile.json, "profile '" + profile.id + "'"));
  const pb::Needle& needle = exercise.has_needle() ? exercise.needle() : parsed.needle();
  if (const auto faults = unreachableTargets(parsed, needle.length_m()); !faults.empty())
    return Error{ErrorCode::kInvalidInput,
                 fmt::format("{}profile_id: a target of '{}' cannot be reached: {}",
                             path.empty() ? "" : path + ".", profile.id, faults.front())};
  return checkPlan(exercise, parsed, path);
}

/// Exercises that do not fit this profile, one sentence each: they continue to use it, but their course is
/// refused at its next change.
Result<std::vector<std::string>> exercisesThatDoNotFit(Connection& reader, const StoredProfile& profile) {
  ASSIGN_OR_RETURN(const auto courses, CurriculumStore(reader).list());
  std::vector<std::string> warnings;
  for (const StoredCurriculum& course : courses) {
    for (const StoredExercise& exercise : course.exercises) {
      if (exercise.profile_id != profile.id) continue;
      if (const Status fits = exerciseFits(exercise, profile, ""); !fits)
        warnings.push_back(
            fmt::format("exercise '{}' of course '{}': {}", exercise.id, course.id, fits.error().message));
    }
  }
  return warnings;
}

/// Each exercise must fit its profile. The store refuses an unknown profile.
Status exercisesFit(const Context& context, const StoredCurriculum& curriculum) {
  for (std::size_t i = 0; i < curriculum.exercises.size(); ++i) {
    const StoredExercise& stored = curriculum.exercises[i];
    ASSIGN_OR_RETURN(const auto exercise, exerciseOf(stored));
    const auto profile = ProfileStore(context.reader).get(stored.profile_id, 0);
    if (!profile) continue;
    if (exercise.has_needle()) RETURN_IF_ERROR(profileWithNeedle(profile->json, exercise));
    if (const Status fits = exerciseFits(stored, *profile, fmt::format("exercises[{}]", i)); !fits)
      return Error{fits.error().code, "curriculum: " + fits.error().message};
  }
  return {};
}

}  // namespace

Result<pb::Reply> importProfile(const Context& context, const pb::ImportProfile& call) {
  ASSIGN_OR_RETURN(auto profile,
                   storedProfileOf(call.json(), "profile", context.who.name, context.now_unix_ns));
  ASSIGN_OR_RETURN(const auto warnings, exercisesThatDoNotFit(context.reader, profile));
  std::string detail;
  RETURN_IF_ERROR(edit(context, profile.id, detail, [&](Connection& writer) {
    const auto before = ProfileStore(writer).get(profile.id, 0);
    const auto revision = ProfileStore(writer).put(profile, baseOf(call));
    if (!revision) return Status(revision.error());
    profile.revision = *revision;
    detail = fmt::format("revision {}{}", *revision, changedFields(before ? before->json : "", profile.json));
    return Status();
  }));
  pb::Reply reply = profileReply(profile);
  reply.mutable_profile()->mutable_warnings()->Assign(warnings.begin(), warnings.end());
  return reply;
}

Result<pb::Reply> getProfile(const Context& context, const pb::GetProfile& call) {
  ASSIGN_OR_RETURN(const auto profile, ProfileStore(context.reader).get(call.id(), call.revision()));
  return profileReply(profile);
}

Result<pb::Reply> listProfiles(const Context& context, const pb::ListProfiles&) {
  ASSIGN_OR_RETURN(const auto profiles, ProfileStore(context.reader).list());
  pb::Reply reply;
  auto* list = reply.mutable_profiles();
  for (const StoredProfile& profile : profiles) {
    auto* entry = list->add_profiles();
    entry->set_id(profile.id);
    entry->set_revision(profile.revision);
    entry->set_name(profile.name);
    entry->set_created_unix_ns(profile.created_unix_ns);
    entry->set_author(profile.author);
  }
  return reply;
}

Result<pb::Reply> importCurriculum(const Context& context, const pb::ImportCurriculum& call) {
  ASSIGN_OR_RETURN(auto curriculum,
                   storedCurriculumOf(call.json(), "curriculum", context.who.name, context.now_unix_ns));
  RETURN_IF_ERROR(exercisesFit(context, curriculum));
  std::string detail;
  RETURN_IF_ERROR(edit(context, curriculum.id, detail, [&](Connection& writer) {
    const auto before = CurriculumStore(writer).get(curriculum.id);
    const auto revision = CurriculumStore(writer).put(curriculum, baseOf(call));
    if (!revision) return Status(revision.error());
    curriculum.revision = *revision;
    detail =
        fmt::format("revision {}{}", *revision, changedFields(before ? before->json : "", curriculum.json));
    return Status();
  }));
  return curriculumReply(curriculum);
}

Result<pb::Reply> getCurriculum(const Context& context, const pb::GetCurriculum& call) {
  ASSIGN_OR_RETURN(const auto curriculum, CurriculumStore(context.reader).get(call.id(), call.revision()));
  RETURN_IF_ERROR(requireVisible(context.reader, curriculum, context.who.name, context.who.role));
  return curriculumReply(curriculum);
}

Result<pb::Reply> listCurricula(const Context& context, const pb::ListCurricula&) {
  ASSIGN_OR_RETURN(const auto curricula, CurriculumStore(context.reader).list());
  pb::Reply reply;
  auto* list = reply.mutable_curricula();
  for (const StoredCurriculum& curriculum : curricula) {
    ASSIGN_OR_RETURN(const bool seen,
                     seesCourse(context.reader, curriculum, context.who.name, context.who.role));
    if (!seen) continue;
    auto* entry = list->add_curricula();
    entry->set_id(curriculum.id);
    entry->set_name(curriculum.name);
    entry->set_revision(curriculum.revision);
    entry->set_created_unix_ns(curriculum.created_unix_ns);
    entry->set_author(curriculum.author);
    for (const StoredExercise& exercise : curriculum.exercises) {
      entry->add_exercise_ids(exercise.id);
      entry->set_exam(exercise.rules.exam_attempts.has_value());  // the course's rule: same for all
    }
  }
  return reply;
}

Result<pb::Reply> getLesson(const Context& context, const pb::GetLesson& call) {
  // a trainee's progress is private; without a trainee, everyone may see the lesson
  if (!call.trainee().empty()) {
    RETURN_IF_ERROR(requireOwnData(context, call.trainee(), "lessons"));
  }
  ASSIGN_OR_RETURN(const auto view, Transaction::begin(context.reader, Transaction::Kind::kRead));
  ASSIGN_OR_RETURN(const auto exercise, CurriculumStore(context.reader).exercise(call.exercise_id()));
  RETURN_IF_ERROR(mayPractise(context.reader, call.trainee(), context.who.role));
  ASSIGN_OR_RETURN(const bool code_checked, checkCodeOf(context, call.trainee(), call.code()));
  const bool own = context.who.role == pb::TRAINEE;
  RETURN_IF_ERROR(
      mayBegin(context.reader, exercise, own ? context.who.name : call.trainee(), context.who.role));
  ASSIGN_OR_RETURN(const auto parsed, exerciseOf(exercise));
  pb::Reply reply;
  auto* lesson = reply.mutable_lesson();
  lesson->set_code_checked(code_checked);
  lesson->set_assigned_only(exercise.rules.assigned_only);
  lesson->set_exam(exercise.rules.exam_attempts.has_value());
  lesson->set_results_from_unix_ns(exercise.rules.results_from_unix_ns);
  ASSIGN_OR_RETURN(const auto person, outerRef(context.reader, call.trainee()));
  lesson->set_person_ref(person.value_or(""));
  if (!call.trainee().empty()) {
    ASSIGN_OR_RETURN(const auto standing, standingOf(context.reader, call.trainee(), exercise, parsed));
    ASSIGN_OR_RETURN(const auto why_not, whyNot(context.reader, parsed, exercise.rules, standing));
    if (why_not) return Error{ErrorCode::kDenied, *why_not};
    lesson->set_attempt(standing.attempts.all + 1);
    if (standing.attempts_left) lesson->set_attempts_left(*standing.attempts_left);
    lesson->set_due_unix_ns(standing.due_unix_ns);
  }
  ASSIGN_OR_RETURN(const auto profile, ProfileStore(context.reader).get(exercise.profile_id, 0));
  lesson->set_exercise_json(exercise.json);
  lesson->set_profile_json(profile.json);
  lesson->set_profile_revision(profile.revision);
  if (parsed.has_needle()) {
    ASSIGN_OR_RETURN(auto with_needle, profileWithNeedle(profile.json, parsed));
    lesson->set_profile_json(std::move(with_needle));
  }
  return reply;
}

namespace {

template <typename Stored>
Result<pb::Reply> revisionsReply(const Result<std::vector<Stored>>& all, const std::string& page) {
  if (!all) return all.error();
  ASSIGN_OR_RETURN(const auto from, numberOfPage(page));
  pb::Reply reply;
  auto* list = reply.mutable_revisions();
  PageRoom room;
  for (const Stored& one : *all) {
    // newest first: the next page begins below this revision
    if (from != 0 && one.revision >= from) continue;
    if (!room.take(one.name.size() + kMaxNameBytes + 32)) {
      list->set_next_page(std::to_string(list->revisions().rbegin()->revision()));
      break;
    }
    auto* entry = list->add_revisions();
    entry->set_revision(one.revision);
    entry->set_name(one.name);
    entry->set_author(one.author);
    entry->set_created_unix_ns(one.created_unix_ns);
  }
  return reply;
}

/// "layers[2].cutting_force_n: is missing" → path and text; a message without a path concerns the whole
/// document.
void addProblem(pb::TextCheck& check, std::string message) {
  auto* problem = check.add_problems();
  const std::size_t colon = message.find(": ");
  const bool is_path = colon != std::string::npos && message.find_first_of(" \t\"'") > colon;
  problem->set_path(is_path ? message.substr(0, colon) : std::string());
  problem->set_message(is_path ? message.substr(colon + 2) : std::move(message));
}

/// Removes the source's name, with which messages begin.
std::string withoutSource(const std::string& message, const std::string& source) {
  return message.starts_with(source + ": ") ? message.substr(source.size() + 2) : message;
}

}  // namespace

Result<pb::Reply> profileRevisions(const Context& context, const pb::ListRevisions& call) {
  return revisionsReply(ProfileStore(context.reader).revisions(call.id()), call.page());
}

Result<pb::Reply> curriculumRevisions(const Context& context, const pb::ListRevisions& call) {
  return revisionsReply(CurriculumStore(context.reader).revisions(call.id()), call.page());
}

Result<pb::Reply> checkJson(const Context& context, const pb::CheckText& call) {
  const bool is_course = call.kind() == "course";
  if (!is_course && !call.kind().empty() && call.kind() != "profile")
    return Error{ErrorCode::kInvalidInput, "kind: '" + call.kind() + "', allowed are profile, course"};
  pb::Reply reply;
  auto* check = reply.mutable_text_check();
  if (is_course) {
    const auto course = storedCurriculumOf(call.json(), "course", context.who.name, context.now_unix_ns);
    if (!course) addProblem(*check, withoutSource(course.error().message, "course"));
    // checks that need the store
    ASSIGN_OR_RETURN(const auto profiles, ThingNames::read(context.reader, Thing::kProfile));
    ASSIGN_OR_RETURN(auto exercises, ThingNames::read(context.reader, Thing::kExercise));
    for (std::size_t i = 0; course && i < course->exercises.size(); ++i) {
      const StoredExercise& exercise = course->exercises[i];
      const std::string path = fmt::format("exercises[{}]", i);
      if (const Status known = profiles.require(exercise.profile_id); !known)
        addProblem(*check, path + ".profile_id: " + known.error().message);
      else if (const auto profile = ProfileStore(context.reader).get(exercise.profile_id, 0); !profile)
        return profile.error();
      else if (const Status fits = exerciseFits(exercise, *profile, path); !fits)
        addProblem(*check, fits.error().message);
      if (const std::string question = exercises.question(exercise.id); !question.empty())
        addProblem(*check, path + ".id: " + question);
      exercises.add(exercise.id, exercise.name);
      const auto other = CurriculumStore(context.reader).exercise(exercise.id);
      if (other && other->curriculum_id != course->id)
        addProblem(*check,
                   path + ".id: there is an exercise of this id in course '" + other->curriculum_id + "'");
    }
  } else {
    const auto profile = parseProfile(call.json(), "profile");
    const auto stored = storedProfileOf(call.json(), "profile", context.who.name, context.now_unix_ns);
    for (const Error& fault : profileFaults(call.json()))
      addProblem(*check, withoutSource(fault.message, "profile"));
    if (profile) {
      for (std::string& warning : profileWarnings(*profile)) check->add_warnings(std::move(warning));
      for (std::string& warning : unreachableTargets(*profile, profile->needle().length_m()))
        check->add_warnings(std::move(warning));
    }
    if (stored) {
      ASSIGN_OR_RETURN(const auto plans, exercisesThatDoNotFit(context.reader, *stored));
      for (const std::string& warning : plans) check->add_warnings(warning);
    }
  }
  check->set_ok(check->problems().empty());
  return reply;
}

Result<pb::Reply> listExercises(const Context& context, const pb::ListExercises& call) {
  ASSIGN_OR_RETURN(const auto from, numberOfPage(call.page()));
  ASSIGN_OR_RETURN(const auto courses, CurriculumStore(context.reader).list());
  pb::Reply reply;
  auto* list = reply.mutable_exercises();
  PageRoom room;
  std::uint64_t at = 0;
  for (const StoredCurriculum& course : courses) {
    if (!call.course_id().empty() && course.id != call.course_id()) continue;
    ASSIGN_OR_RETURN(const bool seen, seesCourse(context.reader, course, context.who.name, context.who.role));
    if (!seen) {
      at += course.exercises.size();
      continue;
    }
    std::uint32_t position = 0;
    for (const StoredExercise& exercise : course.exercises) {
      const std::uint32_t place = position++;
      if (at++ < from) continue;
      if (!room.take(exercise.json.size() + 128)) {
        list->set_next_page(std::to_string(at - 1));
        return reply;
      }
      auto* row = list->add_exercises();
      row->set_course_id(course.id);
      row->set_position(place);
      row->set_json(exercise.json);
      row->set_course_revision(course.revision);
    }
  }
  return reply;
}

Result<pb::Reply> listMeasures(const Context&, const pb::ListMeasures&) {
  pb::Reply reply;
  auto* list = reply.mutable_measures();
  list->set_definition_version(kScoreDefinitionVersion);
  for (const MeasureKind& kind : measureKinds()) {
    auto* row = list->add_measures();
    row->set_name(std::string(kind.name));
    row->set_unit(std::string(kind.unit));
    row->set_words(std::string(kind.words));
    row->set_better(std::string(betterName(kind.better)));
    row->set_definition(std::string(kind.definition));
  }
  return reply;
}

}  // namespace needlelab::handlers
