#include "db/meta_store.h"

namespace needlelab {

Status MetaStore::set(std::string_view key, std::string_view value) {
  return connection_.run(
      "INSERT INTO meta (key, value) VALUES (?,?) ON CONFLICT (key) DO UPDATE SET value = excluded.value",
      key, value);
}

Result<std::optional<std::string>> MetaStore::get(std::string_view key) {
  auto row = connection_.query("SELECT value FROM meta WHERE key = ?", key);
  const auto found = row.step();
  if (!found) return found.error();
  if (!*found) return std::optional<std::string>();
  return std::optional(row.text(0));
}

}  // namespace needlelab
