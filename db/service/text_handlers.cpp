// What there is to learn: revisions of profiles and courses, checks as somebody types, exercises, measures.
#include "common/profile/profile.h"
#include "common/scoring/measure_table.h"
#include "common/scoring/measures.h"
#include "db/documents.h"
#include "db/service/handlers.h"
#include "db/service/lesson_texts.h"
#include "db/service/page.h"

namespace needlelab::handlers {
namespace {

template <typename Stored>
Result<pb::Reply> revisionsReply(const Result<std::vector<Stored>>& all, const std::string& page) {
  if (!all) return all.error();
  const auto from = numberOfPage(page);
  if (!from) return from.error();
  pb::Reply reply;
  auto* list = reply.mutable_revisions();
  PageRoom room;
  for (const Stored& one : *all) {
    // newest first: the page goes on below a revision
    if (*from != 0 && one.revision >= *from) continue;
    if (!room.take(one.name.size() + one.author.size() + 32)) {
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

/// "layers[2].cutting_force_n: is missing" → path and words; a message without a path is about the whole.
void addProblem(pb::TextCheck& check, std::string message) {
  auto* problem = check.add_problems();
  const std::size_t colon = message.find(": ");
  const bool is_path = colon != std::string::npos && message.find_first_of(" \t\"'") > colon;
  problem->set_path(is_path ? message.substr(0, colon) : std::string());
  problem->set_message(is_path ? message.substr(colon + 2) : std::move(message));
}

/// Messages begin with the name of their source.
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
    // what only the store knows
    for (std::size_t i = 0; course && i < course->exercises.size(); ++i) {
      const StoredExercise& exercise = course->exercises[i];
      const std::string path = "exercises[" + std::to_string(i) + "]";
      if (const auto profile = ProfileStore(context.reader).get(exercise.profile_id, 0); !profile)
        addProblem(*check, path + ".profile_id: " + profile.error().message);
      const auto other = CurriculumStore(context.reader).exercise(exercise.id);
      if (other && other->curriculum_id != course->id)
        addProblem(*check,
                   path + ".id: there is an exercise of this id in course '" + other->curriculum_id + "'");
    }
  } else {
    const auto profile = parseProfile(call.json(), "profile");
    for (const Error& fault : profileFaults(call.json()))
      addProblem(*check, withoutSource(fault.message, "profile"));
    if (profile) {
      for (std::string& warning : profileWarnings(*profile)) check->add_warnings(std::move(warning));
    }
  }
  check->set_ok(check->problems().empty());
  return reply;
}

Result<pb::Reply> listExercises(const Context& context, const pb::ListExercises& call) {
  const auto from = numberOfPage(call.page());
  if (!from) return from.error();
  const auto courses = CurriculumStore(context.reader).list();
  if (!courses) return courses.error();
  pb::Reply reply;
  auto* list = reply.mutable_exercises();
  PageRoom room;
  std::uint64_t at = 0;
  for (const StoredCurriculum& course : *courses) {
    if (!call.course_id().empty() && course.id != call.course_id()) continue;
    std::uint32_t position = 0;
    for (const StoredExercise& exercise : course.exercises) {
      const std::uint32_t place = position++;
      if (at++ < *from) continue;
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
