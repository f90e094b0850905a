#include <optional>

#include "common/profile/profile.h"
#include "common/scoring/measures.h"
#include "db/documents.h"
#include "db/people.h"
#include "db/service/handlers.h"
#include "db/service/lesson_texts.h"
#include "db/service/page.h"
#include "db/service/standing.h"

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

/// The revision that an edit was made from; nothing: whichever is there.
template <typename Call>
std::optional<std::uint32_t> baseOf(const Call& call) {
  return call.has_base_revision() ? std::optional(call.base_revision()) : std::nullopt;
}

/// An exercise's own needle makes a scene with its profile. A profile that is not there is the store's to
/// refuse.
Status needlesFit(const Context& context, const StoredCurriculum& curriculum) {
  for (const StoredExercise& stored : curriculum.exercises) {
    const auto exercise = exerciseOf(stored);
    if (!exercise) return exercise.error();
    if (!exercise->has_needle()) continue;
    const auto profile = ProfileStore(context.reader).get(stored.profile_id, 0);
    if (!profile) continue;
    if (const auto fits = profileWithNeedle(profile->json, *exercise); !fits) return fits.error();
  }
  return {};
}

}  // namespace

Result<pb::Reply> importProfile(const Context& context, const pb::ImportProfile& call) {
  auto profile = storedProfileOf(call.json(), "profile", context.who.name, context.now_unix_ns);
  if (!profile) return profile.error();
  std::string detail;
  const auto status = edit(context, profile->id, detail, [&](Connection& writer) {
    const auto before = ProfileStore(writer).get(profile->id, 0);
    const auto revision = ProfileStore(writer).put(*profile, baseOf(call));
    if (!revision) return Status(revision.error());
    profile->revision = *revision;
    detail =
        "revision " + std::to_string(*revision) + changedFields(before ? before->json : "", profile->json);
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
  if (auto fit = needlesFit(context, *curriculum); !fit) return fit.error();
  std::string detail;
  const auto status = edit(context, curriculum->id, detail, [&](Connection& writer) {
    const auto before = CurriculumStore(writer).get(curriculum->id);
    const auto revision = CurriculumStore(writer).put(*curriculum, baseOf(call));
    if (!revision) return Status(revision.error());
    curriculum->revision = *revision;
    detail =
        "revision " + std::to_string(*revision) + changedFields(before ? before->json : "", curriculum->json);
    return Status();
  });
  if (!status) return status.error();
  return curriculumReply(*curriculum);
}

Result<pb::Reply> getCurriculum(const Context& context, const pb::GetCurriculum& call) {
  const auto curriculum = CurriculumStore(context.reader).get(call.id(), call.revision());
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
    entry->set_created_unix_ns(curriculum.created_unix_ns);
    entry->set_author(curriculum.author);
    for (const StoredExercise& exercise : curriculum.exercises) entry->add_exercise_ids(exercise.id);
  }
  return reply;
}

Result<pb::Reply> getLesson(const Context& context, const pb::GetLesson& call) {
  // how far somebody is is that person's; for nobody, anybody may look at a lesson
  if (!call.trainee().empty()) {
    if (auto own = ownOnly(context, call.trainee(), "lessons"); !own) return own.error();
  }
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
  const auto parsed = exerciseOf(*exercise);
  if (!parsed) return parsed.error();
  pb::Reply reply;
  auto* lesson = reply.mutable_lesson();
  if (!call.trainee().empty()) {
    const auto standing = standingOf(context.reader, call.trainee(), *exercise, *parsed);
    if (!standing) return standing.error();
    const auto why_not = whyNot(context.reader, *parsed, *standing);
    if (!why_not) return why_not.error();
    if (*why_not) return Error{ErrorCode::kDenied, **why_not};
    lesson->set_attempt(standing->attempts.all + 1);
    if (standing->attempts_left) lesson->set_attempts_left(*standing->attempts_left);
    lesson->set_due_unix_ns(standing->due_unix_ns);
  }
  const auto profile = ProfileStore(context.reader).get(exercise->profile_id, 0);
  if (!profile) return profile.error();
  lesson->set_exercise_json(exercise->json);
  lesson->set_profile_json(profile->json);
  lesson->set_profile_revision(profile->revision);
  if (parsed->has_needle()) {
    auto with_needle = profileWithNeedle(profile->json, *parsed);
    if (!with_needle) return with_needle.error();
    lesson->set_profile_json(std::move(*with_needle));
  }
  return reply;
}

}  // namespace needlelab::handlers
