#include "db/profile_store.h"

#include "common/base/text.h"
#include "db/revision.h"

namespace needlelab {

Result<std::uint32_t> ProfileStore::put(const StoredProfile& profile, std::optional<std::uint32_t> base) {
  for (const Status& valid :
       {checkName("profile id", profile.id), checkText("profile name", profile.name, 1, 200),
        checkNote("profile '" + profile.id + "'", profile.json, 2, kMaxJsonBytes)}) {
    if (!valid) return valid.error();
  }
  NewestRevision before;
  const auto stored = get(profile.id, 0);
  if (stored) {
    before = {stored->revision, stored->author, stored->created_unix_ns};
  } else if (stored.error().code != ErrorCode::kNotFound) {
    return stored.error();
  }
  if (auto newest = checkBase("profile '" + profile.id + "'", base, before); !newest) return newest.error();
  if (stored && stored->json == profile.json) return stored->revision;
  const std::uint32_t newest = before.revision;
  if (auto done = connection_.run(
          "INSERT INTO profiles (id, revision, name, json, author, created_unix_ns) VALUES (?,?,?,?,?,?)",
          profile.id, newest + 1, profile.name, profile.json, profile.author, profile.created_unix_ns);
      !done) {
    return done.error();
  }
  return newest + 1;
}

Result<StoredProfile> ProfileStore::get(std::string_view id, std::uint32_t revision) {
  auto row = connection_.query(
      "SELECT id, revision, name, json, author, created_unix_ns FROM profiles WHERE id = ?1 AND (?2 = 0 OR "
      "revision = ?2)"
      " ORDER BY revision DESC LIMIT 1",
      id, revision);
  const auto found = row.step();
  if (!found) return found.error();
  if (!*found) {
    return Error{ErrorCode::kNotFound, "there is no profile '" + std::string(id) + "'" +
                                           (revision == 0 ? "" : " of revision " + std::to_string(revision))};
  }
  return StoredProfile{row.text(0), static_cast<std::uint32_t>(row.natural(1)),
                       row.text(2), row.text(3),
                       row.text(4), row.integer(5)};
}

Result<std::vector<StoredProfile>> ProfileStore::list() {
  std::vector<StoredProfile> profiles;
  auto rows = connection_.prepare(
      "SELECT id, revision, name, author, created_unix_ns FROM profiles AS p"
      " WHERE revision = (SELECT max(revision) FROM profiles WHERE id = p.id) ORDER BY id");
  for (;;) {
    const auto row = rows.step();
    if (!row) return row.error();
    if (!*row) return profiles;
    profiles.push_back({rows.text(0), static_cast<std::uint32_t>(rows.natural(1)), rows.text(2), "",
                        rows.text(3), rows.integer(4)});
  }
}

Result<std::vector<StoredProfile>> ProfileStore::revisions(std::string_view id) {
  std::vector<StoredProfile> found;
  auto rows = connection_.query(
      "SELECT revision, name, author, created_unix_ns FROM profiles WHERE id = ? ORDER BY revision DESC", id);
  for (;;) {
    const auto row = rows.step();
    if (!row) return row.error();
    if (!*row) break;
    found.push_back({std::string(id), static_cast<std::uint32_t>(rows.natural(0)), rows.text(1), "",
                     rows.text(2), rows.integer(3)});
  }
  if (found.empty()) return Error{ErrorCode::kNotFound, "there is no profile '" + std::string(id) + "'"};
  return found;
}

}  // namespace needlelab
