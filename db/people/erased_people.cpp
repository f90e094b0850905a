#include "db/people/erased_people.h"

#include "db/people/person_name.h"
#include "db/people/pseudonyms.h"

namespace needlelab {

Result<bool> wasErased(Connection& connection, std::string_view name, std::int64_t started_unix_ns,
                       std::int64_t now_unix_ns) {
  ASSIGN_OR_RETURN(const auto any, connection.prepare("SELECT 1 FROM erased_names LIMIT 1").first(firstText));
  if (!any) return false;
  ASSIGN_OR_RETURN(const auto key, PseudonymKey::ofFolder(connection.path().parent_path()));
  ASSIGN_OR_RETURN(const auto found,
                   connection
                       .query("SELECT 1 FROM erased_names WHERE hash = ? AND until_unix_ns > ?"
                              " AND until_unix_ns - ? > ?",
                              ByteView(key.nameHash(nameKey(trimmedName(name)))), now_unix_ns,
                              kErasedNamesKept_ns, started_unix_ns)
                       .first(firstText));
  return found.has_value();
}

Result<bool> isErased(Connection& connection, const Uuid& person) {
  ASSIGN_OR_RETURN(
      const auto found,
      connection.query("SELECT 1 FROM erasures WHERE uuid = ?", ByteView(person)).first(firstText));
  return found.has_value();
}

}  // namespace needlelab
