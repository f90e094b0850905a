#include "db/consent_store.h"

#include "common/base/text.h"
#include "db/people_store.h"

namespace needlelab {
namespace {

pb::Consent consentOf(const Statement& row) {
  pb::Consent consent;
  consent.set_given(row.integer(0) != 0);
  consent.set_unix_ns(row.integer(1));
  consent.set_recorded_by(row.text(2));
  consent.set_note(row.text(3));
  return consent;
}

}  // namespace

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
