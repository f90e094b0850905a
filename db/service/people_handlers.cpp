#include "base/text_rules.h"
#include "db/curriculum_store.h"
#include "db/password.h"
#include "db/people_store.h"
#include "db/station_store.h"
#include "service/handlers.h"
#include "service/page.h"
#include "service/roles.h"

namespace needlelab::handlers {
namespace {

pb::Reply done() {
  pb::Reply reply;
  reply.mutable_done();
  return reply;
}

/// Who hold other people's data must be able to log in; a trainee need not.
Result<std::string> hashFor(pb::Role role, const std::string& password) {
  if (password.empty() && role == pb::TRAINEE) return std::string();
  return hashPassword(password);
}

Status stationExists(const Context& context, const std::string& name) {
  const auto station = StationStore(context.reader).find(name);
  if (!station) return station.error();
  if (!*station) return Error{ErrorCode::kNotFound, "there is no station named '" + name + "'"};
  return {};
}

}  // namespace

Result<pb::Reply> addUser(const Context& context, const pb::AddUser& call) {
  // the slow part first, on this thread; the writer's thread only stores
  if (auto valid = checkName("name", call.name()); !valid) return valid.error();
  const auto hash = hashFor(call.role(), call.password());
  if (!hash) return hash.error();
  const Person person{call.name(), call.role(), *hash, false, context.now_unix_ns};
  const auto status = write(context, call.name(), std::string(roleName(call.role())),
                            [&](Connection& writer) { return PeopleStore(writer).add(person); });
  if (!status) return status.error();
  return done();
}

Result<pb::Reply> setPassword(const Context& context, const pb::SetPassword& call) {
  if (context.who.role != pb::ADMINISTRATOR && context.who.name != call.name()) {
    return Error{ErrorCode::kDenied, "only an administrator sets other people's passwords"};
  }
  const auto hash = hashPassword(call.password());
  if (!hash) return hash.error();
  const auto status = write(context, call.name(), "", [&](Connection& writer) {
    return PeopleStore(writer).setPasswordHash(call.name(), *hash);
  });
  if (!status) return status.error();
  return done();
}

Result<pb::Reply> disableUser(const Context& context, const pb::DisableUser& call) {
  const auto status =
      write(context, call.name(), call.enable() ? "enabled again" : "disabled",
            [&](Connection& writer) { return PeopleStore(writer).setDisabled(call.name(), !call.enable()); });
  if (!status) return status.error();
  return done();
}

Result<pb::Reply> listUsers(const Context& context, const pb::ListUsers& call) {
  const auto people = PeopleStore(context.reader).list();
  if (!people) return people.error();
  pb::Reply reply;
  auto* users = reply.mutable_users();
  PageRoom room;
  for (const Person& person : *people) {
    if (person.name <= call.page()) continue;
    if (!room.take(person.name.size() + 32)) {
      users->set_next_page(users->users().rbegin()->name());
      break;
    }
    auto* user = users->add_users();
    user->set_name(person.name);
    user->set_role(person.role);
    user->set_disabled(person.disabled);
    user->set_created_unix_ns(person.created_unix_ns);
    user->set_has_password(!person.password_hash.empty());
  }
  return reply;
}

Result<pb::Reply> addStation(const Context& context, const pb::AddStation& call) {
  const StationKeyBytes key = makeStationKey();
  const auto status = write(context, call.name(), "", [&](Connection& writer) {
    return StationStore(writer).add(call.name(), hashStationKey(key), context.now_unix_ns);
  });
  if (!status) return status.error();
  pb::Reply reply;
  reply.mutable_station_key()->set_name(call.name());
  reply.mutable_station_key()->set_key(key.data(), key.size());
  return reply;
}

Result<pb::Reply> revokeStation(const Context& context, const pb::RevokeStation& call) {
  const auto status = write(context, call.name(), "",
                            [&](Connection& writer) { return StationStore(writer).revoke(call.name()); });
  if (!status) return status.error();
  return done();
}

Result<pb::Reply> listStations(const Context& context, const pb::ListStations& call) {
  const auto stations = StationStore(context.reader).list();
  if (!stations) return stations.error();
  pb::Reply reply;
  auto* list = reply.mutable_stations();
  PageRoom room;
  for (const Station& station : *stations) {
    if (station.name <= call.page()) continue;
    // the server adds what each one does just now
    if (!room.take(station.name.size() + 512)) {
      list->set_next_page(list->stations().rbegin()->name());
      break;
    }
    auto* info = list->add_stations();
    info->set_name(station.name);
    info->set_revoked(station.revoked);
    info->set_created_unix_ns(station.created_unix_ns);
  }
  return reply;
}

Result<pb::Reply> traineeMessage(const Context& context, const pb::TraineeMessage& call) {
  if (auto valid = checkNote("text", call.text(), 1, kMaxNoteBytes); !valid) return valid.error();
  if (auto known = stationExists(context, call.station()); !known) return known.error();
  return done();
}

Result<pb::Reply> nextExercise(const Context& context, const pb::NextExercise& call) {
  if (auto known = stationExists(context, call.station()); !known) return known.error();
  const auto exercise = CurriculumStore(context.reader).exercise(call.exercise_id());
  if (!exercise) return exercise.error();
  return done();
}

}  // namespace needlelab::handlers
