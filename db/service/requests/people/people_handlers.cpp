#include <algorithm>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "common/base/text/text.h"
#include "db/login/credentials.h"
#include "db/people/people.h"
#include "db/people/person_name.h"
#include "db/service/context/code_guard.h"
#include "db/service/context/code_tries.h"
#include "db/service/requests/handlers.h"

namespace needlelab::handlers {
namespace {

/// Everyone but trainees needs a password that is not easily guessed, because they see other people's data.
Result<std::string> hashFor(pb::Role role, const std::string& name, const std::string& password) {
  if (password.empty() && role == pb::TRAINEE) return std::string();
  if (role != pb::TRAINEE) RETURN_IF_ERROR(checkStaffPassword(password, name));
  return hashPassword(password);
}

/// People who change their own password must give the current one: an unlocked computer is not enough. After
/// wrong ones they must wait as after wrong codes.
Status checkOldPassword(const Context& context, const pb::SetPassword& call) {
  if (context.who.name != call.name()) return {};
  ASSIGN_OR_RETURN(const auto person, PeopleStore(context.reader).find(call.name()));
  if (!person || person->password_hash.empty()) return {};  // --data, or no password yet
  if (call.old_password().empty())
    return Error{ErrorCode::kInvalidInput,
                 "old_password: is missing: to change your own password, give the present one, too"};
  const std::string counted = "password\n" + call.name();  // no code's name contains a line feed
  ASSIGN_OR_RETURN(const auto attempt, context.codes.begin(counted));
  if (attempt.must_wait.count() > 0)
    return Error{ErrorCode::kDenied,
                 "old_password: too many wrong ones; try again in " + waitText(attempt.must_wait)};
  const auto right = verifyPassword(person->password_hash, call.old_password());
  if (!right.ok()) {
    (void)context.codes.giveBack(counted);
    return right.error();
  }
  if (!*right) return Error{ErrorCode::kDenied, "old_password: is not the password of '" + call.name() + "'"};
  return context.codes.forget(counted);
}

/// Before kMaxGroupsOfPerson existed, a person could be in any number of groups: the reply must have room for
/// a page of people.
constexpr std::size_t kMaxGroupsListed = 1000;
static_assert(kMaxGroupsListed >= kMaxGroupsOfPerson &&
              kMaxGroupsListed * (kMaxNameBytes + 2) < kMaxReplyBytes / 8);

/// Groups and consents of several people, by ref: two reads, however many people there are.
struct PersonDetails {
  std::map<std::string, std::vector<std::string>> groups;
  std::map<std::string, pb::Consent> consents;
};
Result<PersonDetails> detailsOf(Connection& connection, std::span<const Person> people) {
  std::vector<std::string> refs;
  for (const Person& person : people) refs.push_back(person.ref);
  PersonDetails besides;
  ASSIGN_OR_RETURN(besides.groups, GroupStore(connection).groupsOfMany(refs));
  ASSIGN_OR_RETURN(besides.consents, ConsentStore(connection).newestConsents(refs));
  return besides;
}

pb::User userOf(const Person& person, PersonDetails& besides) {
  pb::User user;
  user.set_name(person.ref);
  user.set_id(person.ref);
  user.set_role(person.role);
  user.set_disabled(person.disabled);
  user.set_created_unix_ns(person.created_unix_ns);
  user.set_has_password(!person.password_hash.empty());
  user.set_has_code(!person.code_hash.empty());
  user.set_full_name(person.full_name);
  user.set_revision(person.revision);
  user.set_changed_unix_ns(person.changed_unix_ns);
  user.set_changed_by(person.changed_by);
  const auto& groups = besides.groups[person.ref];
  const std::size_t listed = std::min(groups.size(), kMaxGroupsListed);
  for (std::size_t i = 0; i < listed; ++i) user.add_groups(groups[i]);
  user.set_more_groups(static_cast<std::uint32_t>(groups.size() - listed));
  if (const auto consent = besides.consents.find(person.ref); consent != besides.consents.end())
    *user.mutable_consent() = std::move(consent->second);
  return user;
}

Result<Person> knownPerson(Connection& connection, const std::string& name) {
  auto person = PeopleStore(connection).find(name);
  if (!person) return person.error();
  if (!*person) return Error{ErrorCode::kNotFound, "there is no person named '" + printable(name) + "'"};
  return std::move(**person);
}

/// For the reply after a change: call on the writer, so that it contains that change and no later one.
Result<pb::Reply> userReply(Connection& connection, const std::string& name) {
  ASSIGN_OR_RETURN(const auto person, knownPerson(connection, name));
  ASSIGN_OR_RETURN(auto besides, detailsOf(connection, std::span(&person, 1)));
  pb::Reply reply;
  *reply.mutable_user() = userOf(person, besides);
  return reply;
}

/// People may set their own password. A manager may set the passwords of lower roles: a password gives all
/// rights of its owner.
Status maySetPassword(const Context& context, Connection& connection, const std::string& name) {
  if (context.who.role == pb::ADMINISTRATOR || context.who.name == name) return {};
  ASSIGN_OR_RETURN(const auto person, PeopleStore(connection).find(name));
  const bool below = person && person->role < pb::CURRICULUM_MANAGER;
  if (context.who.role == pb::CURRICULUM_MANAGER && below) return {};
  return Error{ErrorCode::kDenied,
               "only an administrator sets other people's passwords, and a curriculum manager those of "
               "trainees and instructors"};
}

bool changesNothing(const Person& person, const pb::ChangeUser& call) {
  return (!call.has_role() || call.role() == person.role) &&
         (!call.has_disabled() || call.disabled() == person.disabled) &&
         (!call.has_full_name() || call.full_name() == person.full_name) &&
         (!call.has_new_name() || trimmedName(call.new_name()) == person.name);
}

/// kDenied unless the requester may end or restore this person's access: managers cannot lock out another
/// manager, but can lock out themselves.
Status mayEndAccess(const Context& context, const Person& person) {
  RETURN_IF_ERROR(mayManage(context, person.role));
  if (context.who.role == pb::ADMINISTRATOR || person.role < pb::CURRICULUM_MANAGER ||
      person.ref == context.who.name)
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
  RETURN_IF_ERROR(mayManage(context, to));
  // otherwise a manager could demote another manager to instructor, set their password, and log in as that
  // person
  if (context.who.role == pb::ADMINISTRATOR || from < pb::CURRICULUM_MANAGER) return {};
  return Error{ErrorCode::kDenied, "the role " + std::string(roleName(from)) +
                                       " is taken away by administrators, '" + context.who.name + "' is " +
                                       std::string(roleName(context.who.role))};
}

Result<pb::Reply> addUser(const Context& context, const pb::AddUser& call) {
  const std::string name(trimmedName(call.name()));
  // do the slow part first, on this thread; the writer's thread only stores
  RETURN_IF_ERROR(checkNewPersonName("name", name));
  RETURN_IF_ERROR(mayManage(context, call.role()));
  ASSIGN_OR_RETURN(const auto hash, hashFor(call.role(), name, call.password()));
  const Person person{name, call.role(), hash, false, context.now_unix_ns, call.full_name()};
  std::string ref;
  RETURN_IF_ERROR(write(context, ref, std::string(roleName(call.role())),
                        [&](Connection& writer) -> Status { return PeopleStore(writer).add(person, &ref); }));
  return doneReply();
}

Result<pb::Reply> setPassword(const Context& context, const pb::SetPassword& call) {
  RETURN_IF_ERROR(maySetPassword(context, context.reader, call.name()));
  RETURN_IF_ERROR(checkOldPassword(context, call));
  ASSIGN_OR_RETURN(const auto person, knownPerson(context.reader, call.name()));
  if (call.password().empty())
    return Error{ErrorCode::kInvalidInput, "password: is empty; a password is replaced, never taken away"};
  ASSIGN_OR_RETURN(const auto hash, hashFor(person.role, person.name, call.password()));
  const Status written = write(context, call.name(), "", [&](Connection& writer) -> Status {
    // check again: hashing took a while
    RETURN_IF_ERROR(maySetPassword(context, writer, call.name()));
    RETURN_IF_ERROR(PeopleStore(writer).setPasswordHash(call.name(), hash));
    noteAccessChanged(context);
    return keepOwnAccess(context, writer, call.name());
  });
  if (!written) return written.error();
  return doneReply();
}

Result<pb::Reply> disableUser(const Context& context, const pb::DisableUser& call) {
  {
    ASSIGN_OR_RETURN(const auto person, knownPerson(context.reader, call.name()));
    RETURN_IF_ERROR(mayEndAccess(context, person));
    if (person.disabled != call.enable()) {  // already so, perhaps by a request whose result was lost
      if (!call.enable()) noteAccessChanged(context);
      return doneReply();
    }
  }
  const Status written =
      writeIfChanged(context, call.name(), call.enable() ? "enabled again" : "disabled",
                     [&](Connection& writer) -> Result<bool> {
                       ASSIGN_OR_RETURN(const auto person, knownPerson(writer, call.name()));
                       RETURN_IF_ERROR(mayEndAccess(context, person));
                       const bool changes = person.disabled == call.enable();
                       if (changes)
                         RETURN_IF_ERROR(PeopleStore(writer).setDisabled(
                             call.name(), !call.enable(), context.who.name, context.now_unix_ns));
                       if (!call.enable()) noteAccessChanged(context);
                       return changes;
                     });
  if (!written) return written.error();
  return doneReply();
}

Result<pb::Reply> getUser(const Context& context, const pb::GetUser& call) {
  RETURN_IF_ERROR(requireOwnData(context, call.name(), "data"));
  return userReply(context.reader, call.name());
}

Result<pb::Reply> changeUser(const Context& context, const pb::ChangeUser& call) {
  {
    ASSIGN_OR_RETURN(const auto person, knownPerson(context.reader, call.name()));
    RETURN_IF_ERROR(mayManage(context, person.role));
    if (call.base_revision() == person.revision && changesNothing(person, call)) {
      if (call.disabled()) noteAccessChanged(context);
      return userReply(context.reader, call.name());
    }
  }
  pb::Reply reply;
  std::string detail;
  const auto addDetail = [&](const std::string& text) { detail += (detail.empty() ? "" : "; ") + text; };
  // all in the writer's transaction, so that the checks use the current role and rights
  const Status written = edit(context, call.name(), detail, [&](Connection& writer) -> Status {
    ASSIGN_OR_RETURN(const auto person, knownPerson(writer, call.name()));
    RETURN_IF_ERROR(mayManage(context, person.role));
    PersonChange change;
    bool access_changed = false;
    if (call.has_role() && call.role() != person.role) {
      RETURN_IF_ERROR(mayChangeRole(context, person.role, call.role()));
      if (call.role() != pb::TRAINEE && person.password_hash.empty())
        return Error{ErrorCode::kInvalidInput, "role: '" + call.name() +
                                                   "' has no password, and only trainees do without: set one "
                                                   "first"};
      addDetail("role: " + std::string(roleName(person.role)) + " to " + std::string(roleName(call.role())));
      change.role = call.role();
      access_changed = true;
    }
    if (call.has_disabled() && call.disabled() != person.disabled) {
      RETURN_IF_ERROR(mayEndAccess(context, person));
      addDetail(call.disabled() ? "disabled" : "enabled again");
      change.disabled = call.disabled();
      access_changed = access_changed || call.disabled();
    }
    if (call.has_full_name() && call.full_name() != person.full_name) {
      addDetail("full name");
      change.full_name = call.full_name();
    }
    if (call.has_new_name() && trimmedName(call.new_name()) != person.name) {
      addDetail("name");
      change.name = trimmedName(call.new_name());
    }
    RETURN_IF_ERROR(PeopleStore(writer).change(call.name(), call.base_revision(), change, context.who.name,
                                               context.now_unix_ns));
    ASSIGN_OR_RETURN(reply, userReply(writer, call.name()));
    if (access_changed) noteAccessChanged(context);
    return {};
  });
  if (!written) return written.error();
  return reply;
}

namespace {

/// Whether the same person stated or recorded the same: nothing new, and the first time counts.
bool hasSameText(const pb::Consent& before, const pb::Consent& now) {
  return before.given() == now.given() && before.note() == now.note() &&
         before.recorded_by() == now.recorded_by();
}

}  // namespace

Result<pb::Reply> setConsent(const Context& context, const pb::SetConsent& call) {
  RETURN_IF_ERROR(requireOwnData(context, call.name(), "consent"));
  pb::Consent consent;
  consent.set_given(call.given());
  consent.set_note(call.note());
  consent.set_recorded_by(context.who.name);
  consent.set_unix_ns(context.now_unix_ns);
  ASSIGN_OR_RETURN(const auto newest, ConsentStore(context.reader).newest(call.name()));
  if (newest && hasSameText(*newest, consent)) return userReply(context.reader, call.name());
  pb::Reply reply;
  const Status written = writeIfChanged(
      context, call.name(), call.given() ? "given" : "withdrawn", [&](Connection& writer) -> Result<bool> {
        ASSIGN_OR_RETURN(const auto before, ConsentStore(writer).newest(call.name()));
        const bool is_new = !before || !hasSameText(*before, consent);
        if (is_new) RETURN_IF_ERROR(ConsentStore(writer).add(call.name(), consent));
        ASSIGN_OR_RETURN(reply, userReply(writer, call.name()));
        return is_new;
      });
  if (!written) return written.error();
  return reply;
}

Result<pb::Reply> listConsents(const Context& context, const pb::ListConsents& call) {
  RETURN_IF_ERROR(requireOwnData(context, call.name(), "consent"));
  RETURN_IF_ERROR(knownPerson(context.reader, call.name()));
  PageRoom room;
  // limits the list for a person with thousands of statements: the newest are listed
  ASSIGN_OR_RETURN(const auto consents,
                   ConsentStore(context.reader).newestOnes(call.name(), [&](const pb::Consent& consent) {
                     return room.take(consent);
                   }));
  pb::Reply reply;
  auto* list = reply.mutable_consents();
  for (auto consent = consents.rbegin(); consent != consents.rend(); ++consent)
    *list->add_consents() = *consent;
  return reply;
}

Result<pb::Reply> listUsers(const Context& context, const pb::ListUsers& call) {
  // with more at once, PostgreSQL's driver would hold the groups of all of them, up to kMaxGroupsOfPerson
  // each
  constexpr std::uint64_t kMost = 500, kReadAtOnce = 100;
  if (!call.search().empty()) RETURN_IF_ERROR(checkText("search", call.search(), 1, kMaxNameBytes));
  PeopleStore::Filter filter{call.search(), std::nullopt};
  if (call.role() != pb::ROLE_UNSPECIFIED) filter.role = call.role();
  PeopleStore store(context.reader);
  const std::uint64_t most = call.limit() == 0 ? UINT32_MAX : std::min<std::uint64_t>(call.limit(), kMost);
  pb::Reply reply;
  auto* users = reply.mutable_users();
  if (call.page().empty()) {
    ASSIGN_OR_RETURN(const auto total, store.count(filter));
    users->set_total(total);
  }
  PageRoom room;
  std::string after = call.page();
  for (;;) {
    // one more than fits on the page shows whether there is a next one
    const auto left = most - static_cast<std::uint64_t>(users->users_size());
    const std::uint64_t wanted = std::min(left + 1, kReadAtOnce);
    ASSIGN_OR_RETURN(const auto people, store.page(filter, after, wanted));
    ASSIGN_OR_RETURN(auto besides, detailsOf(context.reader, people));
    for (const Person& person : people) {
      pb::User user = userOf(person, besides);
      const bool is_full = static_cast<std::uint64_t>(users->users_size()) == most;
      if (is_full || !room.take(user)) {
        users->set_next_page(after);
        return reply;
      }
      after = person.name;
      *users->add_users() = std::move(user);
    }
    if (people.size() < wanted) return reply;
  }
}

}  // namespace needlelab::handlers
