#include "db/people/people.h"

#include <fmt/core.h>

#include <algorithm>
#include <iterator>
#include <span>

#include "common/base/text/text.h"
#include "db/people/look_alikes.h"
#include "db/people/person_name.h"
#include "db/people/person_refs.h"
#include "db/store/rows.h"

namespace needlelab {
namespace {

constexpr std::string_view kSelectPeople =
    "SELECT name, role, password_hash, disabled, created_unix_ns, full_name,"
    " revision, changed_unix_ns, changed_by, code_hash, ref FROM accounts ";

/// PeopleStore::Filter: the search ?1, the role ?2 (0: any).
constexpr std::string_view kFiltered =
    "(?2 = 0 OR role = ?2) AND (?1 = '' OR instr(lower(name), lower(?1)) > 0"
    " OR instr(lower(full_name), lower(?1)) > 0 OR ref IN"
    " (SELECT person FROM group_members WHERE instr(lower(group_id), lower(?1)) > 0))";

Person personOf(const Statement& row) {
  return {row.text(0),      static_cast<pb::Role>(row.integer(1)),
          row.text(2),      row.integer(3) != 0,
          row.integer(4),   row.text(5),
          row.natural32(6), row.integer(7),
          row.text(8),      row.text(9),
          row.text(10)};
}

Status checkRoleOfPerson(pb::Role role) {
  if (role >= pb::TRAINEE && role <= pb::Role_MAX && role != pb::STATION) return {};
  return Error{
      ErrorCode::kInvalidInput,
      fmt::format("role: {}, allowed are trainee, instructor, curriculum-manager, administrator, researcher",
                  static_cast<int>(role))};
}

Error unknown(std::string_view who) {
  return {ErrorCode::kNotFound, "there is no person named '" + std::string(who) + "'"};
}

/// The members' refs in a canonical order; a group's members are ordered by name.
std::vector<std::string> sortedMembers(const pb::Group& group) {
  std::vector<std::string> members(group.members().begin(), group.members().end());
  std::sort(members.begin(), members.end());
  return members;
}

constexpr std::string_view kGroup = "SELECT id, name, revision, changed_by, changed_unix_ns FROM groups ";

pb::Group groupOf(const Statement& row) {
  pb::Group group;
  group.set_id(row.text(0));
  group.set_name(row.text(1));
  group.set_revision(row.natural32(2));
  group.set_changed_by(row.text(3));
  group.set_changed_unix_ns(row.integer(4));
  return group;
}

/// Sorted, without duplicates. kInvalidInput.
Result<std::vector<std::string>> membersOf(const pb::Group& group) {
  if (group.members_size() > kMaxGroupMembers)
    return Error{ErrorCode::kInvalidInput, fmt::format("group '{}', members: has {}, allowed are at most {}",
                                                       group.id(), group.members_size(), kMaxGroupMembers)};
  auto members = sortedMembers(group);
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

Error noMember(const std::string& group_id, const std::string& member) {
  return {ErrorCode::kNotFound,
          "group '" + group_id + "', members: there is no person named '" + printable(member) + "'"};
}

Error tooManyGroupsError(const std::string& group_id, const std::string& member) {
  return {ErrorCode::kInvalidInput,
          fmt::format("group '{}', members: '{}' is in {} groups, a person is in at most as many", group_id,
                      printable(member), kMaxGroupsOfPerson)};
}

}  // namespace

Result<std::string> PeopleStore::refOf(std::string_view who) {
  if (isPersonRef(who)) return std::string(who);
  ASSIGN_OR_RETURN(auto ref, findPerson(connection_, who));
  return ref.value_or(std::string(who));
}

Status PeopleStore::add(const Person& person, std::string* given_ref) {
  RETURN_IF_ERROR(checkNewPersonName("name", person.name));
  RETURN_IF_ERROR(checkRoleOfPerson(person.role));
  RETURN_IF_ERROR(checkNewText("full_name", person.full_name, 0, 200));
  ASSIGN_OR_RETURN(const auto known, findNamed(person.name));
  if (known) return Error{ErrorCode::kAlreadyExists, sameNameQuestion(known->name, person.name)};
  ASSIGN_OR_RETURN(
      const auto id,
      connection_.insert("INSERT INTO people (uuid, role, password_hash, disabled, created_unix_ns,"
                         " changed_unix_ns, code_hash) VALUES (?,?,nullif(?, ''),?,?,?,nullif(?, ''))"
                         " RETURNING id",
                         ByteView(makeUuidV7()), static_cast<int>(person.role), person.password_hash,
                         person.disabled, person.created_unix_ns, person.created_unix_ns, person.code_hash));
  RETURN_IF_ERROR(addNameOf(connection_, id, person.name, person.full_name, false));
  if (given_ref != nullptr) *given_ref = "@" + std::to_string(id);
  return {};
}

Status PeopleStore::setPasswordHash(std::string_view who, std::string_view hash) {
  ASSIGN_OR_RETURN(const auto ref, refOf(who));
  RETURN_IF_ERROR(
      connection_.run("UPDATE people SET password_hash = ? WHERE ref = ? AND role <> 0", hash, ref));
  if (connection_.changes() == 0) return unknown(who);
  return {};
}

Status PeopleStore::setCodeHash(std::string_view who, std::string_view hash) {
  ASSIGN_OR_RETURN(const auto ref, refOf(who));
  RETURN_IF_ERROR(
      connection_.run("UPDATE people SET code_hash = nullif(?, '') WHERE ref = ? AND role <> 0", hash, ref));
  if (connection_.changes() == 0) return unknown(who);
  return {};
}

Result<Person> PeopleStore::change(std::string_view who, std::optional<std::uint32_t> base,
                                   const PersonChange& change, std::string_view by,
                                   std::int64_t now_unix_ns) {
  ASSIGN_OR_RETURN(auto person, find(who));
  if (!person) return unknown(who);
  Person& now = *person;
  RETURN_IF_ERROR(
      checkBase("person '" + now.name + "'", base,
                {now.revision, now.changed_by.empty() ? "(as added)" : now.changed_by, now.changed_unix_ns}));
  const Person before = now;
  now.role = change.role.value_or(now.role);
  now.disabled = change.disabled.value_or(now.disabled);
  now.full_name = change.full_name.value_or(now.full_name);
  RETURN_IF_ERROR(checkRoleOfPerson(now.role));
  if (now.full_name != before.full_name) RETURN_IF_ERROR(checkNewText("full_name", now.full_name, 0, 200));
  now.name = change.name.value_or(now.name);
  if (now.name != before.name) {
    RETURN_IF_ERROR(checkNewPersonName("name", now.name));
    ASSIGN_OR_RETURN(const auto known, findNamed(now.name));
    if (known && known->ref != now.ref)
      return Error{ErrorCode::kAlreadyExists, sameNameQuestion(known->name, now.name)};
  }
  if (now.role == before.role && now.disabled == before.disabled && now.full_name == before.full_name &&
      now.name == before.name)
    return now;

  if (now.disabled || now.role != pb::ADMINISTRATOR) RETURN_IF_ERROR(checkNotLast(before));
  ++now.revision;
  now.changed_by = by;
  now.changed_unix_ns = now_unix_ns;
  RETURN_IF_ERROR(
      connection_.run("UPDATE people SET role = ?, disabled = ?, revision = ?, changed_by = ?,"
                      " changed_unix_ns = ? WHERE ref = ?",
                      static_cast<int>(now.role), now.disabled, now.revision, by, now_unix_ns, now.ref));
  RETURN_IF_ERROR(
      connection_.run("UPDATE names SET name = ?, folded = ?, full_name = ?"
                      " WHERE person = (SELECT id FROM people WHERE ref = ?)",
                      now.name, nameKey(now.name), now.full_name, now.ref));
  return now;
}

Status PeopleStore::checkNotLast(const Person& person) {
  if (person.role != pb::ADMINISTRATOR || person.disabled) return {};
  auto others = connection_.query(
      "SELECT count(*) FROM people WHERE role = ? AND disabled = 0"
      " AND password_hash IS NOT NULL AND ref <> ?",
      static_cast<int>(pb::ADMINISTRATOR), person.ref);
  RETURN_IF_ERROR(others.step());
  if (others.integer(0) != 0) return {};
  return Error{ErrorCode::kDenied,
               "'" + person.name + "' is the last administrator who can log in: add another first"};
}

Status PeopleStore::setDisabled(std::string_view who, bool disabled, std::string_view by,
                                std::int64_t now_unix_ns) {
  const auto changed = change(who, {}, {.disabled = disabled}, by, now_unix_ns);
  return changed ? Status() : Status(changed.error());
}

Result<std::optional<Person>> PeopleStore::find(std::string_view who) {
  ASSIGN_OR_RETURN(const auto ref, refOf(who));
  return connection_.query(std::string(kSelectPeople) + "WHERE ref = ?", ref).first(personOf);
}

Result<std::optional<Person>> PeopleStore::findNamed(std::string_view name) {
  return connection_.query(std::string(kSelectPeople) + "WHERE folded = ?", nameKey(name)).first(personOf);
}

Result<std::map<std::string, Person>> PeopleStore::findAll(std::span<const std::string> refs) {
  Statement rows = connection_.prepare(std::string(kSelectPeople) + "WHERE ref" + amongTexts(connection_, 1));
  bindTexts(connection_, rows, refs);
  ASSIGN_OR_RETURN(auto people, rows.all(personOf));
  std::map<std::string, Person> found;
  for (Person& person : people) {
    std::string ref = person.ref;
    found.emplace(std::move(ref), std::move(person));
  }
  return found;
}

Result<std::vector<Person>> PeopleStore::list() {
  return connection_.prepare(std::string(kSelectPeople) + "ORDER BY name").all(personOf);
}

Result<std::vector<Person>> PeopleStore::page(const Filter& filter, std::string_view after,
                                              std::uint64_t most) {
  return connection_
      .query(fmt::format("{}WHERE name > ?3 AND {} ORDER BY name LIMIT ?4", kSelectPeople, kFiltered),
             filter.search, static_cast<int>(filter.role.value_or(pb::ROLE_UNSPECIFIED)), after, most)
      .all(personOf);
}

Result<std::uint32_t> PeopleStore::count(const Filter& filter) {
  auto row = connection_.query(fmt::format("SELECT count(*) FROM accounts WHERE {}", kFiltered),
                               filter.search, static_cast<int>(filter.role.value_or(pb::ROLE_UNSPECIFIED)));
  ASSIGN_OR_RETURN(const bool there, row.step());
  return there ? row.natural32(0) : 0;
}

Result<pb::Group> GroupStore::put(const pb::Group& group, std::optional<std::uint32_t> base,
                                  const std::string& by, std::int64_t now_unix_ns) {
  RETURN_IF_ERROR(checkName("group id", group.id()));
  RETURN_IF_ERROR(checkText("group '" + group.id() + "', name", group.name(), 1, 200));
  ASSIGN_OR_RETURN(const auto wanted, membersOf(group));

  // a removed group's revision numbers continue, but an edit does not find the group
  std::uint32_t last = 0;
  {
    auto row = connection_.query("SELECT revision, removed FROM groups WHERE id = ?", group.id());
    ASSIGN_OR_RETURN(const bool found, row.step());
    if (found) last = row.natural32(0);
  }
  ASSIGN_OR_RETURN(const auto before, find(group.id()));
  const NewestRevision newest =
      before ? NewestRevision{before->revision(), before->changed_by(), before->changed_unix_ns()}
             : NewestRevision{};
  RETURN_IF_ERROR(checkBase("group '" + group.id() + "'", base, newest));
  if (last == 0) {
    RETURN_IF_ERROR(checkNewName("group id", group.id()));
  }
  if (!before || before->name() != group.name())
    RETURN_IF_ERROR(checkVisible("group '" + group.id() + "', name", group.name()));
  const auto present = before ? sortedMembers(*before) : std::vector<std::string>();
  if (before && before->name() == group.name() && wanted == present) return *before;

  RETURN_IF_ERROR(
      connection_.run("INSERT INTO groups (id, name, revision, changed_by, changed_unix_ns)"
                      " VALUES (?,?,?,?,?) ON CONFLICT (id) DO UPDATE"
                      " SET name = excluded.name, revision = excluded.revision,"
                      " changed_by = excluded.changed_by,"
                      " changed_unix_ns = excluded.changed_unix_ns, removed = 0",
                      group.id(), group.name(), last + 1, by, now_unix_ns));
  RETURN_IF_ERROR(connection_.run("DELETE FROM group_members WHERE group_id = ?", group.id()));
  if (connection_.sqlite() == nullptr) {
    RETURN_IF_ERROR(addMembersInBulk(group.id(), wanted, present));
    return get(group.id());
  }
  for (const std::string& member : wanted) {
    ASSIGN_OR_RETURN(const auto person, PeopleStore(connection_).find(member));
    if (!person) return noMember(group.id(), member);
    if (!std::binary_search(present.begin(), present.end(), member))
      RETURN_IF_ERROR(checkMayJoin(group.id(), member));
    RETURN_IF_ERROR(
        connection_.run("INSERT INTO group_members (group_id, person) VALUES (?,?)", group.id(), member));
  }
  return get(group.id());
}

Status GroupStore::remove(const std::string& id, std::optional<std::uint32_t> base, const std::string& by,
                          std::int64_t now_unix_ns) {
  ASSIGN_OR_RETURN(const auto group, get(id));
  RETURN_IF_ERROR(
      checkBase("group '" + id + "'", base, {group.revision(), group.changed_by(), group.changed_unix_ns()}));
  RETURN_IF_ERROR(connection_.run("DELETE FROM assignments WHERE group_id = ?", id));
  RETURN_IF_ERROR(connection_.run("DELETE FROM group_members WHERE group_id = ?", id));
  return connection_.run(
      "UPDATE groups"
      " SET removed = 1, revision = revision + 1, changed_by = ?, changed_unix_ns = ?"
      " WHERE id = ?",
      by, now_unix_ns, id);
}

Result<pb::Group> GroupStore::get(std::string_view id) {
  ASSIGN_OR_RETURN(auto group, find(id));
  if (group) return *std::move(group);
  RETURN_IF_ERROR(requireThing(connection_, Thing::kGroup, id));
  return Error{ErrorCode::kConflict, "the group '" + printable(id) + "' was made at this moment: ask again"};
}

Result<std::optional<pb::Group>> GroupStore::find(std::string_view id) {
  ASSIGN_OR_RETURN(
      auto group, connection_.query(std::string(kGroup) + "WHERE id = ? AND removed = 0", id).first(groupOf));
  if (!group) return std::optional<pb::Group>();
  ASSIGN_OR_RETURN(auto with_members, withMembers(*std::move(group)));
  return std::optional(std::move(with_members));
}

Result<std::vector<pb::Group>> GroupStore::page(const std::string& search, std::string_view after,
                                                std::uint64_t most) {
  return connection_
      .query(
          "SELECT id, name, revision, changed_by, changed_unix_ns,"
          " (SELECT count(*) FROM group_members m WHERE m.group_id = groups.id) FROM groups"
          " WHERE removed = 0 AND id > ?2 AND (?1 = '' OR instr(lower(id), lower(?1)) > 0"
          " OR instr(lower(name), lower(?1)) > 0) ORDER BY id LIMIT ?3",
          search, after, most)
      .all([](const Statement& row) {
        pb::Group group = groupOf(row);
        group.set_member_count(row.natural32(5));
        return group;
      });
}

Status GroupStore::addMembers(std::span<pb::Group> groups) {
  std::map<std::string, pb::Group*> by_id;
  std::vector<std::string> ids;
  for (pb::Group& group : groups) {
    group.clear_member_count();
    by_id.emplace(group.id(), &group);
    ids.push_back(group.id());
  }
  Statement rows = connection_.prepare(
      "SELECT m.group_id, m.person FROM group_members m JOIN called c ON c.ref = m.person WHERE m.group_id" +
      amongTexts(connection_, 1) + " ORDER BY m.group_id, c.name");
  bindTexts(connection_, rows, ids);
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, rows.step());
    if (!more) return {};
    if (const auto group = by_id.find(rows.text(0)); group != by_id.end())
      group->second->add_members(rows.text(1));
  }
}

Result<pb::Group> GroupStore::withMembers(pb::Group group) {
  ASSIGN_OR_RETURN(const auto names, members(group.id()));
  group.mutable_members()->Add(names.begin(), names.end());
  return group;
}

Result<std::vector<std::string>> GroupStore::groupsOf(std::string_view person) {
  return connection_.query("SELECT group_id FROM group_members WHERE person = ? ORDER BY group_id", person)
      .all(firstText);
}

Result<std::map<std::string, std::vector<std::string>>> GroupStore::groupsOfMany(
    std::span<const std::string> people) {
  Statement rows = connection_.prepare("SELECT person, group_id FROM group_members WHERE person" +
                                       amongTexts(connection_, 1) + " ORDER BY person, group_id");
  bindTexts(connection_, rows, people);
  std::map<std::string, std::vector<std::string>> groups;
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, rows.step());
    if (!more) return groups;
    groups[rows.text(0)].push_back(rows.text(1));
  }
}

Status GroupStore::addMembersInBulk(const std::string& id, const std::vector<std::string>& wanted,
                                    const std::vector<std::string>& present) {
  std::vector<std::string_view> all(wanted.begin(), wanted.end()), join;
  std::copy_if(all.begin(), all.end(), std::back_inserter(join), [&](std::string_view member) {
    return !std::binary_search(present.begin(), present.end(), member);
  });
  auto others = connection_.prepare(
      "SELECT m.person FROM unnest(?1) AS m (person)"
      " WHERE NOT EXISTS (SELECT 1 FROM accounts a WHERE a.ref = m.person) ORDER BY m.person LIMIT 1");
  others.bindList(std::span<const std::string_view>(all));
  ASSIGN_OR_RETURN(const auto unknown, others.first(firstText));
  if (unknown) return noMember(id, *unknown);
  auto of_many = connection_.prepare(
      "SELECT m.person FROM group_members m WHERE m.person = ANY (?1) AND m.group_id <> ?2"
      " GROUP BY m.person HAVING count(*) >= ?3 ORDER BY m.person LIMIT 1");
  of_many.bindList(std::span<const std::string_view>(join)).bind(id).bind(std::uint64_t{kMaxGroupsOfPerson});
  ASSIGN_OR_RETURN(const auto full, of_many.first(firstText));
  if (full) return tooManyGroupsError(id, *full);
  auto insert = connection_.prepare(
      "INSERT INTO group_members (group_id, person) SELECT ?1, m.person FROM unnest(?2) AS m (person)");
  insert.bind(id).bindList(std::span<const std::string_view>(all));
  return insert.run();
}

Status GroupStore::checkMayJoin(const std::string& id, const std::string& person) {
  auto others = connection_.query(
      "SELECT count(*) FROM (SELECT 1 FROM group_members WHERE person = ?1 AND group_id <> ?2 LIMIT ?3) AS "
      "others",
      person, id, std::uint64_t{kMaxGroupsOfPerson});
  RETURN_IF_ERROR(others.step());
  if (others.natural(0) < kMaxGroupsOfPerson) return {};
  return tooManyGroupsError(id, person);
}

Result<std::vector<std::string>> GroupStore::members(std::string_view id) {
  return connection_
      .query(
          "SELECT m.person FROM group_members m JOIN called c ON c.ref = m.person WHERE m.group_id = ?"
          " ORDER BY c.name",
          id)
      .all(firstText);
}

Status ConsentStore::add(const std::string& person, const pb::Consent& consent) {
  RETURN_IF_ERROR(checkText("consent, note", consent.note(), 0, 1000));
  ASSIGN_OR_RETURN(const auto known, PeopleStore(connection_).find(person));
  if (!known) return Error{ErrorCode::kNotFound, "there is no person named '" + printable(person) + "'"};
  return connection_.run(
      "INSERT INTO consents (person, given, unix_ns, recorded_by, note) VALUES (?,?,?,?,?)", known->ref,
      consent.given(), consent.unix_ns(), consent.recorded_by(), consent.note());
}

Result<std::vector<pb::Consent>> ConsentStore::newestOnes(
    std::string_view person, const std::function<bool(const pb::Consent&)>& take) {
  std::vector<pb::Consent> consents;
  RowsAtOnce at_once(kBytesOfPage);
  for (std::int64_t before = INT64_MAX;;) {
    auto rows = connection_.query(
        "SELECT given, unix_ns, recorded_by, note, id FROM consents WHERE person = ? AND id < ?"
        " ORDER BY id DESC LIMIT ?",
        person, before, at_once.count());
    for (bool all = false; !all;) {
      ASSIGN_OR_RETURN(auto consent, rows.first(consentOf));
      if (!consent || !take(*consent)) return consents;
      before = rows.integer(4);
      all = at_once.took(consent->ByteSizeLong());
      consents.push_back(*std::move(consent));
    }
  }
}

Result<std::optional<pb::Consent>> ConsentStore::newest(std::string_view person) {
  return connection_
      .query(
          "SELECT given, unix_ns, recorded_by, note FROM consents WHERE person = ? ORDER BY id DESC LIMIT 1",
          person)
      .first(consentOf);
}

Result<std::map<std::string, pb::Consent>> ConsentStore::newestConsents(std::span<const std::string> people) {
  Statement rows = connection_.prepare(
      "SELECT c.given, c.unix_ns, c.recorded_by, c.note, p.ref FROM people p JOIN consents c ON c.id ="
      " (SELECT n.id FROM consents n WHERE n.person = p.ref ORDER BY n.id DESC LIMIT 1) WHERE p.ref" +
      amongTexts(connection_, 1));
  bindTexts(connection_, rows, people);
  std::map<std::string, pb::Consent> consents;
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, rows.step());
    if (!more) return consents;
    consents.emplace(rows.text(4), consentOf(rows));
  }
}

Result<std::vector<std::string>> ConsentStore::consenting() {
  return connection_
      .prepare(
          "SELECT ref FROM accounts WHERE (SELECT given FROM consents WHERE person = ref"
          " ORDER BY id DESC LIMIT 1) = 1 ORDER BY name")
      .all(firstText);
}

}  // namespace needlelab
