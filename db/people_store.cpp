#include "db/people_store.h"

#include "base/text_rules.h"

namespace needlelab {
namespace {

constexpr std::string_view kSelectPeople =
    "SELECT name, role, password_hash, disabled, created_unix_ns FROM people ";

Person personOf(const Statement& row) {
  return {row.text(0), static_cast<pb::Role>(row.integer(1)), row.text(2), row.integer(3) != 0,
          row.integer(4)};
}

Error unknown(std::string_view name) {
  return {ErrorCode::kNotFound, "there is no person named '" + std::string(name) + "'"};
}

}  // namespace

Status PeopleStore::add(const Person& person) {
  if (auto valid = checkName("name", person.name); !valid) return valid;
  if (person.role < pb::TRAINEE || person.role > pb::ADMINISTRATOR) {
    return Error{ErrorCode::kInvalidInput,
                 "role: " + std::to_string(person.role) +
                     ", allowed are trainee, instructor, curriculum-manager, administrator"};
  }
  const auto known = find(person.name);
  if (!known) return known.error();
  if (*known)
    return Error{ErrorCode::kAlreadyExists, "there is already a person named '" + person.name + "'"};
  const std::optional<std::string> hash =
      person.password_hash.empty() ? std::nullopt : std::optional(person.password_hash);
  return connection_.run(
      "INSERT INTO people (name, role, password_hash, disabled, created_unix_ns) VALUES (?,?,?,?,?)",
      person.name, static_cast<int>(person.role), hash, person.disabled, person.created_unix_ns);
}

Status PeopleStore::setPasswordHash(std::string_view name, std::string_view hash) {
  if (auto done = connection_.run("UPDATE people SET password_hash = ? WHERE name = ?", hash, name); !done)
    return done;
  if (connection_.changes() == 0) return unknown(name);
  return {};
}

Status PeopleStore::setDisabled(std::string_view name, bool disabled) {
  const auto person = find(name);
  if (!person) return person.error();
  if (!*person) return unknown(name);
  if (disabled && !(*person)->disabled && (*person)->role == pb::ADMINISTRATOR) {
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
  return connection_.run("UPDATE people SET disabled = ? WHERE name = ?", disabled, name);
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
