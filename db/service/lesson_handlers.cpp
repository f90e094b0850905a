#include "db/curriculum_store.h"
#include "db/people_store.h"
#include "db/profile_store.h"
#include "profile/profile.h"
#include "scoring/measures.h"
#include "service/handlers.h"
#include "service/lesson_texts.h"
#include "service/page.h"

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
  return reply;
}

}  // namespace

Result<pb::Reply> importProfile(const Context& context, const pb::ImportProfile& call) {
  auto profile = storedProfileOf(call.json(), "profile", context.who.name, context.now_unix_ns);
  if (!profile) return profile.error();
  const auto status =
      write(context, profile->id, std::to_string(profile->json.size()) + " bytes", [&](Connection& writer) {
        const auto revision = ProfileStore(writer).put(*profile);
        if (!revision) return Status(revision.error());
        profile->revision = *revision;
        return Status();
      });
  if (!status) return status.error();
  return profileReply(*profile);
}

Result<pb::Reply> getProfile(const Context& context, const pb::GetProfile& call) {
  const auto profile = ProfileStore(context.reader).get(call.id(), call.revision());
  if (!profile) return profile.error();
  return profileReply(*profile);
}

Result<pb::Reply> listProfiles(const Context& context, const pb::ListProfiles&) {
  const auto profiles = ProfileStore(context.reader).list();
  if (!profiles) return profiles.error();
  pb::Reply reply;
  auto* list = reply.mutable_profiles();
  for (const StoredProfile& profile : *profiles) {
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
  auto curriculum = storedCurriculumOf(call.json(), "curriculum", context.who.name, context.now_unix_ns);
  if (!curriculum) return curriculum.error();
  const auto status =
      write(context, curriculum->id, std::to_string(curriculum->exercises.size()) + " exercises",
            [&](Connection& writer) {
              const auto revision = CurriculumStore(writer).put(*curriculum);
              if (!revision) return Status(revision.error());
              curriculum->revision = *revision;
              return Status();
            });
  if (!status) return status.error();
  return curriculumReply(*curriculum);
}

Result<pb::Reply> getCurriculum(const Context& context, const pb::GetCurriculum& call) {
  const auto curriculum = CurriculumStore(context.reader).get(call.id());
  if (!curriculum) return curriculum.error();
  return curriculumReply(*curriculum);
}

Result<pb::Reply> listCurricula(const Context& context, const pb::ListCurricula&) {
  const auto curricula = CurriculumStore(context.reader).list();
  if (!curricula) return curricula.error();
  pb::Reply reply;
  auto* list = reply.mutable_curricula();
  for (const StoredCurriculum& curriculum : *curricula) {
    auto* entry = list->add_curricula();
    entry->set_id(curriculum.id);
    entry->set_name(curriculum.name);
    entry->set_revision(curriculum.revision);
    for (const StoredExercise& exercise : curriculum.exercises) entry->add_exercise_ids(exercise.id);
  }
  return reply;
}

Result<pb::Reply> assign(const Context& context, const pb::Assign& call) {
  const StoredAssignment assignment{call.trainee(), call.exercise_id(), context.who.name,
                                    context.now_unix_ns};
  const auto status = write(context, call.trainee(), call.exercise_id(),
                            [&](Connection& writer) { return CurriculumStore(writer).assign(assignment); });
  if (!status) return status.error();
  pb::Reply reply;
  reply.mutable_done();
  return reply;
}

Result<pb::Reply> listAssignments(const Context& context, const pb::ListAssignments& call) {
  const bool own = context.who.role == pb::TRAINEE;
  if (own && !call.trainee().empty() && call.trainee() != context.who.name) {
    return Error{ErrorCode::kDenied, "a trainee sees own assignments only"};
  }
  const auto from = numberOfPage(call.page());
  if (!from) return from.error();
  const auto assignments =
      CurriculumStore(context.reader).assignments(own ? context.who.name : call.trainee());
  if (!assignments) return assignments.error();
  pb::Reply reply;
  auto* list = reply.mutable_assignments();
  PageRoom room;
  for (std::uint64_t i = *from; i < assignments->size(); ++i) {
    const StoredAssignment& assignment = (*assignments)[i];
    if (!room.take(assignment.trainee.size() + assignment.exercise_id.size() + assignment.by.size() + 32)) {
      list->set_next_page(std::to_string(i));
      break;
    }
    auto* entry = list->add_assignments();
    entry->set_trainee(assignment.trainee);
    entry->set_exercise_id(assignment.exercise_id);
    entry->set_by(assignment.by);
    entry->set_created_unix_ns(assignment.created_unix_ns);
  }
  return reply;
}

Result<pb::Reply> getLesson(const Context& context, const pb::GetLesson& call) {
  const auto exercise = CurriculumStore(context.reader).exercise(call.exercise_id());
  if (!exercise) return exercise.error();
  // an unknown trainee may practise (the station's key vouches for it), a disabled one may not
  if (!call.trainee().empty()) {
    const auto person = PeopleStore(context.reader).find(call.trainee());
    if (!person) return person.error();
    if (*person && (*person)->disabled) {
      return Error{ErrorCode::kDenied, "'" + call.trainee() + "' is disabled: ask an administrator"};
    }
  }
  const auto profile = ProfileStore(context.reader).get(exercise->profile_id, 0);
  if (!profile) return profile.error();
  pb::Reply reply;
  auto* lesson = reply.mutable_lesson();
  lesson->set_exercise_json(exercise->json);
  lesson->set_profile_json(profile->json);
  lesson->set_profile_revision(profile->revision);
  return reply;
}

}  // namespace needlelab::handlers
