// Profiles, courses, exercises, assignments, results.
#include <array>

#include "common/profile/profile.h"
#include "server/web/route_parts.h"

namespace needlelab {
namespace {

using Call = pb::Request;

std::string bodyText(const WebCall& call) {
  return call.body.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

/// `?revision=`; 0 without it.
Result<std::uint32_t> revisionOf(const WebCall& call) {
  const std::string text = call.query("revision");
  if (text.empty()) return 0u;
  const auto number = wholeOf("revision", text, 1, UINT32_MAX);
  if (!number) return number.error();
  return static_cast<std::uint32_t>(*number);
}

/// What is put is what the address names.
Status sameId(const WebCall& call) {
  if (call.body.is_object() && call.body.value("id", nlohmann::json()) == call.parts[0]) return {};
  return Error{ErrorCode::kInvalidInput, "id: is not '" + call.parts[0] + "', as in the address"};
}

// --- profiles

Result<pb::Request> listProfiles(const WebCall&) {
  pb::Request request;
  request.mutable_list_profiles();
  return request;
}
WebJson profilesJson(const WebCall&, const pb::Reply& reply) {
  return listOf(reply.profiles(), "profiles");
}

Result<pb::Request> getProfile(const WebCall& call) {
  pb::Request request;
  const auto revision = revisionOf(call);
  if (!revision) return revision.error();
  request.mutable_get_profile()->set_id(call.parts[0]);
  request.mutable_get_profile()->set_revision(*revision);
  return request;
}
WebJson profileDocument(const WebCall&, const pb::Reply& reply) {
  return jsonOf(reply.profile());
}

Result<pb::Request> putProfile(const WebCall& call) {
  pb::Request request;
  if (auto same = sameId(call); !same) return same.error();
  const auto base = baseOf(call);
  if (!base) return base.error();
  request.mutable_import_profile()->set_json(bodyText(call));
  request.mutable_import_profile()->set_base_revision(*base);
  return request;
}

Result<pb::Request> profileRevisions(const WebCall& call) {
  pb::Request request;
  auto& list = *request.mutable_list_profile_revisions();
  list.set_id(call.parts[0]);
  if (auto page = setPage(call, *list.mutable_page()); !page) return page.error();
  return request;
}
WebJson revisionsJson(const WebCall&, const pb::Reply& reply) {
  return listOf(reply.revisions(), "revisions");
}

Result<pb::Request> checkProfile(const WebCall& call) {
  pb::Request request;
  request.mutable_check_text()->set_json(bodyText(call));
  request.mutable_check_text()->set_kind("profile");
  return request;
}
WebJson checkedJson(const WebCall&, const pb::Reply& reply) {
  return jsonOf(reply.text_check());
}

Result<pb::Request> previewProfile(const WebCall& call) {
  pb::Request request;
  auto& preview = *request.mutable_preview_profile();
  preview.set_json(bodyText(call));
  if (const std::string text = call.query("points"); !text.empty()) {
    const auto number = wholeOf("points", text, 2, 2000);
    if (!number) return number.error();
    preview.set_points(static_cast<std::uint32_t>(*number));
  }
  return request;
}
WebJson previewJson(const WebCall&, const pb::Reply& reply) {
  return jsonOf(reply.profile_preview());
}

// --- courses

Result<pb::Request> listCourses(const WebCall&) {
  pb::Request request;
  request.mutable_list_curricula();
  return request;
}
WebJson coursesJson(const WebCall&, const pb::Reply& reply) {
  return listOf(reply.curricula(), "curricula");
}

Result<pb::Request> getCourse(const WebCall& call) {
  pb::Request request;
  const auto revision = revisionOf(call);
  if (!revision) return revision.error();
  request.mutable_get_curriculum()->set_id(call.parts[0]);
  request.mutable_get_curriculum()->set_revision(*revision);
  return request;
}
WebJson courseDocument(const WebCall&, const pb::Reply& reply) {
  return jsonOf(reply.curriculum());
}

Result<pb::Request> putCourse(const WebCall& call) {
  pb::Request request;
  if (auto same = sameId(call); !same) return same.error();
  const auto base = baseOf(call);
  if (!base) return base.error();
  request.mutable_import_curriculum()->set_json(bodyText(call));
  request.mutable_import_curriculum()->set_base_revision(*base);
  return request;
}

Result<pb::Request> courseRevisions(const WebCall& call) {
  pb::Request request;
  auto& list = *request.mutable_list_curriculum_revisions();
  list.set_id(call.parts[0]);
  if (auto page = setPage(call, *list.mutable_page()); !page) return page.error();
  return request;
}

Result<pb::Request> checkCourse(const WebCall& call) {
  pb::Request request;
  request.mutable_check_text()->set_json(bodyText(call));
  request.mutable_check_text()->set_kind("course");
  return request;
}

Result<pb::Request> listExercises(const WebCall& call) {
  pb::Request request;
  auto& list = *request.mutable_list_exercises();
  list.set_course_id(call.query("course"));
  if (auto page = setPage(call, *list.mutable_page()); !page) return page.error();
  return request;
}
WebJson exercisesJson(const WebCall&, const pb::Reply& reply) {
  return listOf(reply.exercises(), "exercises");
}

Result<pb::Request> listMeasures(const WebCall&) {
  pb::Request request;
  request.mutable_list_measures();
  return request;
}
WebJson measuresJson(const WebCall&, const pb::Reply& reply) {
  WebJson all = listOf(reply.measures(), "measures");
  all["definition_version"] = reply.measures().definition_version();
  return all;
}

// --- assignments and results

Result<pb::Request> listAssignments(const WebCall& call) {
  pb::Request request;
  auto& list = *request.mutable_list_assignments();
  list.set_trainee(call.query("trainee"));
  list.set_course_id(call.query("course"));
  list.set_group_id(call.query("group"));
  if (auto page = setPage(call, *list.mutable_page()); !page) return page.error();
  return request;
}
WebJson assignmentsJson(const WebCall&, const pb::Reply& reply) {
  return listOf(reply.assignments(), "assignments");
}

Result<pb::Request> addAssignment(const WebCall& call) {
  pb::Request request;
  if (auto read = readBodyInto(call, *request.mutable_assign(), {}); !read) return read.error();
  return request;
}
WebJson addedAssignment(const WebCall&, const pb::Reply& reply) {
  return reply.assignments().assignments_size() > 0 ? jsonOf(reply.assignments().assignments(0))
                                                    : WebJson::object();
}

Result<pb::Request> removeAssignment(const WebCall& call) {
  pb::Request request;
  const auto id = wholeOf("id", call.parts[0], 1, INT64_MAX);
  if (!id) return Error{ErrorCode::kNotFound, "there is no assignment of that number"};
  request.mutable_remove_assignment()->set_id(*id);
  return request;
}

Result<pb::Request> getResults(const WebCall& call) {
  pb::Request request;
  auto& ask = *request.mutable_get_results();
  ask.set_course_id(call.query("course"));
  ask.set_group_id(call.query("group"));
  if (auto page = setPage(call, *ask.mutable_page()); !page) return page.error();
  return request;
}
WebJson resultsJson(const WebCall&, const pb::Reply& reply) {
  return jsonOf(reply.results());
}

Result<pb::Request> getProgress(const WebCall& call) {
  pb::Request request;
  auto& ask = *request.mutable_get_progress();
  ask.set_trainee(call.parts[0]);
  ask.set_exercise_id(call.query("exercise"));
  if (auto page = setPage(call, *ask.mutable_page()); !page) return page.error();
  return request;
}
WebJson progressJson(const WebCall&, const pb::Reply& reply) {
  return listOf(reply.progress(), "attempts");
}

constexpr auto kAskFor = WebAction::kRequest;

constexpr auto kLessonRoutes = std::to_array<WebRoute>({
    {"GET", "/profiles", Call::kListProfiles, kAskFor, listProfiles, profilesJson},
    {"POST", "/profiles/check", Call::kCheckText, kAskFor, checkProfile, checkedJson},
    {"POST", "/profiles/preview", Call::kPreviewProfile, kAskFor, previewProfile, previewJson},
    {"GET", "/profiles/{id}", Call::kGetProfile, kAskFor, getProfile, profileDocument},
    {"PUT", "/profiles/{id}", Call::kImportProfile, kAskFor, putProfile, profileDocument},
    {"GET", "/profiles/{id}/revisions", Call::kListProfileRevisions, kAskFor, profileRevisions,
     revisionsJson},
    {"GET", "/courses", Call::kListCurricula, kAskFor, listCourses, coursesJson},
    {"POST", "/courses/check", Call::kCheckText, kAskFor, checkCourse, checkedJson},
    {"GET", "/courses/{id}", Call::kGetCurriculum, kAskFor, getCourse, courseDocument},
    {"PUT", "/courses/{id}", Call::kImportCurriculum, kAskFor, putCourse, courseDocument},
    {"GET", "/courses/{id}/revisions", Call::kListCurriculumRevisions, kAskFor, courseRevisions,
     revisionsJson},
    {"GET", "/exercises", Call::kListExercises, kAskFor, listExercises, exercisesJson},
    {"GET", "/measures", Call::kListMeasures, kAskFor, listMeasures, measuresJson},
    {"GET", "/assignments", Call::kListAssignments, kAskFor, listAssignments, assignmentsJson},
    {"POST", "/assignments", Call::kAssign, kAskFor, addAssignment, addedAssignment, nullptr, 201},
    {"DELETE", "/assignments/{id}", Call::kRemoveAssignment, kAskFor, removeAssignment, emptyReply},
    {"GET", "/results", Call::kGetResults, kAskFor, getResults, resultsJson},
    {"GET", "/people/{name}/progress", Call::kGetProgress, kAskFor, getProgress, progressJson},
});

}  // namespace

std::span<const WebRoute> lessonRoutes() {
  return kLessonRoutes;
}

}  // namespace needlelab
