#include "db/people.h"

#include <algorithm>

#include "common/base/text.h"
#include "db/documents.h"

namespace needlelab {
namespace {

constexpr std::string_view kSelectPeople =
    "SELECT name, role, password_hash, disabled, created_unix_ns, full_name, revision, changed_unix_ns, "
    "changed_by FROM people ";

Person personOf(const Statement& row) {
  return {row.text(0),
          static_cast<pb::Role>(row.integer(1)),
          row.text(2),
          row.integer(3) != 0,
          row.integer(4),
          row.text(5),
          static_cast<std::uint32_t>(row.natural(6)),
          row.integer(7),
          row.text(8)};
}

Status checkRoleOfPerson(pb::Role role) {
  if (role >= pb::TRAINEE && role <= pb::Role_MAX && role != pb::STATION) return {};
  return Error{ErrorCode::kInvalidInput,
               "role: " + std::to_string(role) +
                   ", allowed are trainee, instructor, curriculum-manager, administrator, researcher"};
}

Error unknown(std::string_view name) {
  return {ErrorCode::kNotFound, "there is no person named '" + std::string(name) + "'"};
}

constexpr std::string_view kGroup = "SELECT id, name, revision, changed_by, changed_unix_ns FROM groups ";

pb::Group groupOf(const Statement& row) {
  pb::Group group;
  group.set_id(row.text(0));
  group.set_name(row.text(1));
  group.set_revision(static_cast<std::uint32_t>(row.natural(2)));
  group.set_changed_by(row.text(3));
  group.set_changed_unix_ns(row.integer(4));
  return group;
}

Error noGroup(std::string_view id) {
  return {ErrorCode::kNotFound, "there is no group '" + std::string(id) + "'"};
}

/// Sorted, each once. kInvalidInput.
Result<std::vector<std::string>> membersOf(const pb::Group& group) {
  if (group.members_size() > kMaxGroupMembers)
    return Error{ErrorCode::kInvalidInput, "group '" + group.id() + "', members: has " +
                                               std::to_string(group.members_size()) +
                                               ", allowed are at most " + std::to_string(kMaxGroupMembers)};
  std::vector<std::string> members(group.members().begin(), group.members().end());
  std::sort(members.begin(), members.end());
  const auto twice = std::adjacent_find(members.begin(), members.end());
  if (twice != members.end())
    return Error{ErrorCode::kInvalidInput,
                 "group '" + group.id() + "', members: '" + printable(*twice) + "' is named twice"};
  return members;
}

pb::Consent consentOf(const Statement& row) {
  pb::Consent consent;
  consent.set_given(row.integer(0) != 0);
  consent.set_unix_ns(row.integer(1));
  consent.set_recorded_by(row.text(2));
  consent.set_note(row.text(3));
  return consent;
}

}  // namespace

Status PeopleStore::add(const Person& person) {
  if (auto valid = checkNewName("name", person.name); !valid) return valid;
  if (auto valid = checkRoleOfPerson(person.role); !valid) return valid;
  if (auto valid = checkText("full_name", person.full_name, 0, 200); !valid) return valid;
  const auto known = find(person.name);
  if (!known) return known.error();
  if (*known)
    return Error{ErrorCode::kAlreadyExists, "there is already a person named '" + person.name + "'"};
  const std::optional<std::string> hash =
      person.password_hash.empty() ? std::nullopt : std::optional(person.password_hash);
  return connection_.run(
      "INSERT INTO people (name, role, password_hash, disabled, created_unix_ns, full_name, changed_unix_ns) "
      "VALUES (?,?,?,?,?,?,?)",
      person.name, static_cast<int>(person.role), hash, person.disabled, person.created_unix_ns,
      person.full_name, person.created_unix_ns);
}

Status PeopleStore::setPasswordHash(std::string_view name, std::string_view hash) {
  if (auto done = connection_.run("UPDATE people SET password_hash = ? WHERE name = ?", hash, name); !done)
    return done;
  if (connection_.changes() == 0) return unknown(name);
  return {};
}

Result<Person> PeopleStore::change(std::string_view name, std::optional<std::uint32_t> base,
                                   const PersonChange& change, std::string_view by,
                                   std::int64_t now_unix_ns) {
  auto person = find(name);
  if (!person) return person.error();
  if (!*person) return unknown(name);
  Person& now = **person;
  if (auto newest = checkBase(
          "person '" + now.name + "'", base,
          {now.revision, now.changed_by.empty() ? "(as added)" : now.changed_by, now.changed_unix_ns});
      !newest)
    return newest.error();
  const Person before = now;
  now.role = change.role.value_or(now.role);
  now.disabled = change.disabled.value_or(now.disabled);
  now.full_name = change.full_name.value_or(now.full_name);
  if (auto valid = checkRoleOfPerson(now.role); !valid) return valid.error();
  if (auto valid = checkText("full_name", now.full_name, 0, 200); !valid) return valid.error();
  if (now.role == before.role && now.disabled == before.disabled && now.full_name == before.full_name)
    return now;

  const bool was_admin = before.role == pb::ADMINISTRATOR && !before.disabled;
  if (was_admin && (now.disabled || now.role != pb::ADMINISTRATOR)) {
    auto others = connection_.query(
        "SELECT count(*) FROM people WHERE role = ? AND disabled = 0 AND password_hash IS NOT NULL AND name "
        "<> ?",
        static_cast<int>(pb::ADMINISTRATOR), name);
    const auto row = others.step();
    if (!row) return row.error();
    if (others.integer(0) == 0) {
      return Error{ErrorCode::kDenied,
                   "'" + std::string(name) + "' is the last administrator who can log in: add another first"};
    }
  }
  ++now.revision;
  now.changed_by = by;
  now.changed_unix_ns = now_unix_ns;
  if (auto done = connection_.run(
          "UPDATE people SET role = ?, disabled = ?, full_name = ?, revision = ?, changed_by = ?,"
          " changed_unix_ns = ? WHERE name = ?",
          static_cast<int>(now.role), now.disabled, now.full_name, now.revision, by, now_unix_ns, name);
      !done)
    return done.error();
  return now;
}

Status PeopleStore::setDisabled(std::string_view name, bool disabled, std::string_view by,
                                std::int64_t now_unix_ns) {
  const auto changed = change(name, {}, {.disabled = disabled}, by, now_unix_ns);
  return changed ? Status() : Status(changed.error());
}

Result<std::optional<Person>> PeopleStore::find(std::string_view name) {
  auto row = connection_.query(std::string(kSelectPeople) + "WHERE name = ?", name);
  const auto found = row.step();
  if (!found) return found.error();
  if (!*found) return std::optional<Person>();
  return std::optional(personOf(row));
}

Result<std::vector<Person>> PeopleStore::list() {
  std::vector<Person> people;
  auto rows = connection_.prepare(std::string(kSelectPeople) + "ORDER BY name");
  for (;;) {
    const auto row = rows.step();
    if (!row) return row.error();
    if (!*row) return people;
    people.push_back(personOf(rows));
  }
}

Result<pb::Group> GroupStore::put(const pb::Group& group, std::optional<std::uint32_t> base,
                                  const std::string& by, std::int64_t now_unix_ns) {
  if (auto valid = checkName("group id", group.id()); !valid) return valid.error();
  if (auto valid = checkText("group '" + group.id() + "', name", group.name(), 1, 200); !valid)
    return valid.error();
  const auto wanted = membersOf(group);
  if (!wanted) return wanted.error();

  // a removed group's revisions go on, but for an edit there is none
  std::uint32_t last = 0;
  {
    auto row = connection_.query("SELECT revision, removed FROM groups WHERE id = ?", group.id());
    const auto found = row.step();
    if (!found) return found.error();
    if (*found) last = static_cast<std::uint32_t>(row.natural(0));
  }
  const auto before = get(group.id());
  if (!before && before.error().code != ErrorCode::kNotFound) return before.error();
  const NewestRevision newest =
      before ? NewestRevision{before->revision(), before->changed_by(), before->changed_unix_ns()}
             : NewestRevision{};
  if (auto same = checkBase("group '" + group.id() + "'", base, newest); !same) return same.error();
  if (last == 0) {
    if (auto valid = checkNewName("group id", group.id()); !valid) return valid.error();
  }
  if (before && before->name() == group.name() &&
      std::equal(wanted->begin(), wanted->end(), before->members().begin(), before->members().end()))
    return *before;

  if (auto done = connection_.run(
          "INSERT INTO groups (id, name, revision, changed_by, changed_unix_ns) VALUES (?,?,?,?,?) ON "
          "CONFLICT (id) DO UPDATE"
          " SET name = excluded.name, revision = excluded.revision, changed_by = excluded.changed_by,"
          " changed_unix_ns = excluded.changed_unix_ns, removed = 0",
          group.id(), group.name(), last + 1, by, now_unix_ns);
      !done)
    return done.error();
  if (auto done = connection_.run("DELETE FROM group_members WHERE group_id = ?", group.id()); !done)
    return done.error();
  for (const std::string& member : *wanted) {
    const auto person = PeopleStore(connection_).find(member);
    if (!person) return person.error();
    if (!*person)
      return Error{ErrorCode::kNotFound, "group '" + group.id() + "', members: there is no person named '" +
                                             printable(member) + "'"};
    if (auto done =
            connection_.run("INSERT INTO group_members (group_id, person) VALUES (?,?)", group.id(), member);
        !done)
      return done.error();
  }
  return get(group.id());
}

Status GroupStore::remove(const std::string& id, std::optional<std::uint32_t> base, const std::string& by,
                          std::int64_t now_unix_ns) {
  const auto group = get(id);
  if (!group) return group.error();
  if (auto same = checkBase("group '" + id + "'", base,
                            {group->revision(), group->changed_by(), group->changed_unix_ns()});
      !same)
    return same;
  if (auto done = connection_.run("DELETE FROM assignments WHERE group_id = ?", id); !done) return done;
  if (auto done = connection_.run("DELETE FROM group_members WHERE group_id = ?", id); !done) return done;
  return connection_.run(
      "UPDATE groups SET removed = 1, revision = revision + 1, changed_by = ?, changed_unix_ns = ? WHERE id "
      "= ?",
      by, now_unix_ns, id);
}

Result<pb::Group> GroupStore::get(std::string_view id) {
  std::optional<pb::Group> group;
  {
    auto row = connection_.query(std::string(kGroup) + "WHERE id = ? AND removed = 0", id);
    const auto found = row.step();
    if (!found) return found.error();
    if (!*found) return noGroup(id);
    group = groupOf(row);
  }
  const auto names = members(id);
  if (!names) return names.error();
  for (const std::string& name : *names) group->add_members(name);
  return *group;
}

Result<std::vector<pb::Group>> GroupStore::list() {
  std::vector<pb::Group> groups;
  auto rows = connection_.query(std::string(kGroup) + "WHERE removed = 0 ORDER BY id");
  for (;;) {
    const auto row = rows.step();
    if (!row) return row.error();
    if (!*row) return groups;
    auto& group = groups.emplace_back(groupOf(rows));
    const auto names = members(group.id());
    if (!names) return names.error();
    for (const std::string& name : *names) group.add_members(name);
  }
}

Result<std::vector<std::string>> GroupStore::groupsOf(std::string_view person) {
  std::vector<std::string> ids;
  auto rows =
      connection_.query("SELECT group_id FROM group_members WHERE person = ? ORDER BY group_id", person);
  for (;;) {
    const auto row = rows.step();
    if (!row) return row.error();
    if (!*row) return ids;
    ids.push_back(rows.text(0));
  }
}

Result<std::vector<std::string>> GroupStore::members(std::string_view id) {
  std::vector<std::string> names;
  auto rows = connection_.query("SELECT person FROM group_members WHERE group_id = ? ORDER BY person", id);
  for (;;) {
    const auto row = rows.step();
    if (!row) return row.error();
    if (!*row) return names;
    names.push_back(rows.text(0));
  }
}

Status ConsentStore::add(const std::string& person, const pb::Consent& consent) {
  if (auto valid = checkText("consent, note", consent.note(), 0, 1000); !valid) return valid;
  const auto known = PeopleStore(connection_).find(person);
  if (!known) return known.error();
  if (!*known) return Error{ErrorCode::kNotFound, "there is no person named '" + printable(person) + "'"};
  return connection_.run(
      "INSERT INTO consents (person, given, unix_ns, recorded_by, note) VALUES (?,?,?,?,?)", person,
      consent.given(), consent.unix_ns(), consent.recorded_by(), consent.note());
}

Result<std::vector<pb::Consent>> ConsentStore::list(std::string_view person) {
  std::vector<pb::Consent> consents;
  auto rows = connection_.query(
      "SELECT given, unix_ns, recorded_by, note FROM consents WHERE person = ? ORDER BY id", person);
  for (;;) {
    const auto row = rows.step();
    if (!row) return row.error();
    if (!*row) return consents;
    consents.push_back(consentOf(rows));
  }
}

Result<std::optional<pb::Consent>> ConsentStore::newest(std::string_view person) {
  auto row = connection_.query(
      "SELECT given, unix_ns, recorded_by, note FROM consents WHERE person = ? ORDER BY id DESC LIMIT 1",
      person);
  const auto found = row.step();
  if (!found) return found.error();
  if (!*found) return std::optional<pb::Consent>();
  return std::optional(consentOf(row));
}

Result<std::vector<std::string>> ConsentStore::consenting() {
  std::vector<std::string> names;
  auto rows = connection_.prepare(
      "SELECT person FROM consents c WHERE id = (SELECT max(id) FROM consents WHERE person = c.person) AND "
      "given = 1"
      " ORDER BY person");
  for (;;) {
    const auto row = rows.step();
    if (!row) return row.error();
    if (!*row) return names;
    names.push_back(rows.text(0));
  }
}

}  // namespace needlelab
