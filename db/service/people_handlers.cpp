#include "common/base/text.h"
#include "db/credentials.h"
#include "db/people.h"
#include "db/service/handlers.h"
#include "db/service/page.h"
#include "db/service/roles.h"

namespace needlelab::handlers {
namespace {

/// Who hold other people's data must be able to log in; a trainee need not.
Result<std::string> hashFor(pb::Role role, const std::string& password) {
  if (password.empty() && role == pb::TRAINEE) return std::string();
  return hashPassword(password);
}

/// With groups and consent, in as many reads.
Result<pb::User> userOf(Connection& connection, const Person& person) {
  pb::User user;
  user.set_name(person.name);
  user.set_role(person.role);
  user.set_disabled(person.disabled);
  user.set_created_unix_ns(person.created_unix_ns);
  user.set_has_password(!person.password_hash.empty());
  user.set_full_name(person.full_name);
  user.set_revision(person.revision);
  user.set_changed_unix_ns(person.changed_unix_ns);
  user.set_changed_by(person.changed_by);
  const auto groups = GroupStore(connection).groupsOf(person.name);
  if (!groups) return groups.error();
  for (const std::string& group : *groups) user.add_groups(group);
  const auto consent = ConsentStore(connection).newest(person.name);
  if (!consent) return consent.error();
  if (*consent) *user.mutable_consent() = **consent;
  return user;
}

Result<Person> knownPerson(Connection& connection, const std::string& name) {
  auto person = PeopleStore(connection).find(name);
  if (!person) return person.error();
  if (!*person) return Error{ErrorCode::kNotFound, "there is no person named '" + printable(name) + "'"};
  return std::move(**person);
}

Result<pb::Reply> userReply(const Context& context, const std::string& name) {
  const auto person = knownPerson(context.reader, name);
  if (!person) return person.error();
  auto user = userOf(context.reader, *person);
  if (!user) return user.error();
  pb::Reply reply;
  *reply.mutable_user() = std::move(*user);
  return reply;
}

/// Oneself; a manager: of those below itself, because a password is all that its owner may.
Status maySetPassword(const Context& context, Connection& connection, const std::string& name) {
  if (context.who.role == pb::ADMINISTRATOR || context.who.name == name) return {};
  const auto person = PeopleStore(connection).find(name);
  if (!person) return person.error();
  const bool below = *person && (*person)->role < pb::CURRICULUM_MANAGER;
  if (context.who.role == pb::CURRICULUM_MANAGER && below) return {};
  return Error{ErrorCode::kDenied,
               "only an administrator sets other people's passwords, and a curriculum manager those of "
               "trainees and instructors"};
}

/// Whose access may be ended, or given back: a manager's equals are not its to lock out, itself is.
Status mayEndAccess(const Context& context, const Person& person) {
  if (auto may = mayManage(context, person.role); !may) return may;
  if (context.who.role == pb::ADMINISTRATOR || person.role < pb::CURRICULUM_MANAGER ||
      person.name == context.who.name)
    return {};
  return Error{ErrorCode::kDenied, "the access of '" + person.name + "', who is " +
                                       std::string(roleName(person.role)) +
                                       ", is ended and given back by administrators, '" + context.who.name +
                                       "' is " + std::string(roleName(context.who.role))};
}

}  // namespace

Status mayManage(const Context& context, pb::Role role) {
  if (context.who.role == pb::ADMINISTRATOR) return {};
  if (context.who.role == pb::CURRICULUM_MANAGER && role <= pb::CURRICULUM_MANAGER) return {};
  return Error{ErrorCode::kDenied, "the role " + std::string(roleName(role)) +
                                       " is managed by administrators, '" + context.who.name + "' is " +
                                       std::string(roleName(context.who.role))};
}

Status mayChangeRole(const Context& context, pb::Role from, pb::Role to) {
  if (auto may = mayManage(context, to); !may) return may;
  // else a manager could make another one an instructor, give it a password, and be that manager
  if (context.who.role == pb::ADMINISTRATOR || from < pb::CURRICULUM_MANAGER) return {};
  return Error{ErrorCode::kDenied, "the role " + std::string(roleName(from)) +
                                       " is taken away by administrators, '" + context.who.name + "' is " +
                                       std::string(roleName(context.who.role))};
}

Status ownOnly(const Context& context, const std::string& name, const std::string& what) {
  const bool limited = context.who.role == pb::TRAINEE || context.who.role == pb::RESEARCHER;
  if (!limited || name == context.who.name) return {};
  return Error{ErrorCode::kDenied,
               "a " + std::string(roleName(context.who.role)) + " sees own " + what + " only"};
}

Result<pb::Reply> addUser(const Context& context, const pb::AddUser& call) {
  // the slow part first, on this thread; the writer's thread only stores
  if (auto valid = checkNewName("name", call.name()); !valid) return valid.error();
  if (auto may = mayManage(context, call.role()); !may) return may.error();
  const auto hash = hashFor(call.role(), call.password());
  if (!hash) return hash.error();
  const Person person{call.name(), call.role(), *hash, false, context.now_unix_ns, call.full_name()};
  const auto status = write(context, call.name(), std::string(roleName(call.role())),
                            [&](Connection& writer) { return PeopleStore(writer).add(person); });
  if (!status) return status.error();
  return doneReply();
}

Result<pb::Reply> setPassword(const Context& context, const pb::SetPassword& call) {
  if (auto may = maySetPassword(context, context.reader, call.name()); !may) return may.error();
  const auto hash = hashPassword(call.password());
  if (!hash) return hash.error();
  const auto status = write(context, call.name(), "", [&](Connection& writer) -> Status {
    // as it is now: hashing took a while
    if (auto may = maySetPassword(context, writer, call.name()); !may) return may;
    return PeopleStore(writer).setPasswordHash(call.name(), *hash);
  });
  if (!status) return status.error();
  return doneReply();
}

Result<pb::Reply> disableUser(const Context& context, const pb::DisableUser& call) {
  const auto status = write(context, call.name(), call.enable() ? "enabled again" : "disabled",
                            [&](Connection& writer) -> Status {
                              const auto person = knownPerson(writer, call.name());
                              if (!person) return person.error();
                              if (auto may = mayEndAccess(context, *person); !may) return may;
                              return PeopleStore(writer).setDisabled(call.name(), !call.enable(),
                                                                     context.who.name, context.now_unix_ns);
                            });
  if (!status) return status.error();
  return doneReply();
}

Result<pb::Reply> getUser(const Context& context, const pb::GetUser& call) {
  if (auto own = ownOnly(context, call.name(), "data"); !own) return own.error();
  return userReply(context, call.name());
}

Result<pb::Reply> changeUser(const Context& context, const pb::ChangeUser& call) {
  std::string detail;
  const auto say = [&](const std::string& words) { detail += (detail.empty() ? "" : "; ") + words; };
  // all of it in the writer's transaction: who it is, and what asks may do to it, is as it is then
  const auto status = edit(context, call.name(), detail, [&](Connection& writer) -> Status {
    const auto person = knownPerson(writer, call.name());
    if (!person) return person.error();
    if (auto may = mayManage(context, person->role); !may) return may;
    PersonChange change;
    if (call.has_role() && call.role() != person->role) {
      if (auto may = mayChangeRole(context, person->role, call.role()); !may) return may;
      if (call.role() != pb::TRAINEE && person->password_hash.empty())
        return Error{ErrorCode::kInvalidInput, "role: '" + call.name() +
                                                   "' has no password, and only trainees do without: set one "
                                                   "first"};
      say("role: " + std::string(roleName(person->role)) + " to " + std::string(roleName(call.role())));
      change.role = call.role();
    }
    if (call.has_disabled() && call.disabled() != person->disabled) {
      if (auto may = mayEndAccess(context, *person); !may) return may;
      say(call.disabled() ? "disabled" : "enabled again");
      change.disabled = call.disabled();
    }
    if (call.has_full_name() && call.full_name() != person->full_name) {
      // last, and in these words: an erasure finds earlier names by them (db/pseudonyms.h)
      say("full name: '" + printable(person->full_name) + "' to '" + printable(call.full_name()) + "'");
      change.full_name = call.full_name();
    }
    const auto changed = PeopleStore(writer).change(call.name(), call.base_revision(), change,
                                                    context.who.name, context.now_unix_ns);
    return changed ? Status() : Status(changed.error());
  });
  if (!status) return status.error();
  return userReply(context, call.name());
}

Result<pb::Reply> setConsent(const Context& context, const pb::SetConsent& call) {
  if (auto own = ownOnly(context, call.name(), "consent"); !own) return own.error();
  pb::Consent consent;
  consent.set_given(call.given());
  consent.set_note(call.note());
  consent.set_recorded_by(context.who.name);
  consent.set_unix_ns(context.now_unix_ns);
  const auto status =
      write(context, call.name(), call.given() ? "given" : "withdrawn",
            [&](Connection& writer) { return ConsentStore(writer).add(call.name(), consent); });
  if (!status) return status.error();
  return userReply(context, call.name());
}

Result<pb::Reply> listConsents(const Context& context, const pb::ListConsents& call) {
  if (auto own = ownOnly(context, call.name(), "consent"); !own) return own.error();
  if (const auto person = knownPerson(context.reader, call.name()); !person) return person.error();
  const auto consents = ConsentStore(context.reader).list(call.name());
  if (!consents) return consents.error();
  pb::Reply reply;
  auto* list = reply.mutable_consents();
  PageRoom room;
  // somebody who changes its mind a thousand times: the newest are what counts
  std::size_t first = consents->size();
  while (first > 0 && room.take((*consents)[first - 1].ByteSizeLong())) --first;
  for (; first < consents->size(); ++first) *list->add_consents() = (*consents)[first];
  return reply;
}

Result<pb::Reply> listUsers(const Context& context, const pb::ListUsers& call) {
  const auto people = PeopleStore(context.reader).list();
  if (!people) return people.error();
  pb::Reply reply;
  auto* users = reply.mutable_users();
  PageRoom room;
  for (const Person& person : *people) {
    if (person.name <= call.page()) continue;
    auto user = userOf(context.reader, person);
    if (!user) return user.error();
    if (!room.take(user->ByteSizeLong())) {
      users->set_next_page(users->users().rbegin()->name());
      break;
    }
    *users->add_users() = std::move(*user);
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
  return doneReply();
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

}  // namespace needlelab::handlers
