#include "db/people_store.h"

#include "common/base/text.h"
#include "db/revision.h"

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

}  // namespace needlelab
