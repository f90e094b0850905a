#include "db/service/restored_access.h"

#include <map>

#include "common/base/bytes.h"
#include "needlelab/types.pb.h"

namespace needlelab {
namespace {

/// A person's or a station's row: what opens the door, and whether it is shut.
struct AccessRow {
  std::string secret;  ///< hash of the password or key
  bool shut = false;
  int role = 0;
};
using AccessRows = std::map<std::string, AccessRow>;

/// Columns that every schema since the first has.
Result<AccessRows> accessRows(Connection& connection, const char* sql) {
  AccessRows all;
  auto rows = connection.prepare(sql);
  for (;;) {
    const auto row = rows.step();
    if (!row) return row.error();
    if (!*row) return all;
    AccessRow& one = all[std::string(rows.text(0))];
    one.secret = std::string(textOf(rows.bytes(1)));
    one.shut = rows.integer(2) != 0;
    one.role = static_cast<int>(rows.integer(3));
  }
}

/// Why what opens the restored database no longer opened the replaced one; empty: it did.
std::string accessEnded(const AccessRow& restored, const AccessRow* replaced, bool station) {
  if (restored.shut || restored.secret.empty()) return {};
  if (replaced == nullptr) return "is not in the replaced database";
  if (replaced->shut) return station ? "its key was revoked" : "was disabled";
  if (replaced->secret != restored.secret)
    return station ? "had got a new key; the old one is valid again, the new one is not"
                   : "had a new password; the old one is valid again";
  if (replaced->role != restored.role)
    return "had become " + pb::Role_Name(replaced->role) + ", is " + pb::Role_Name(restored.role) + " again";
  return {};
}

}  // namespace

Result<std::vector<RestoredAccess>> accessValidAgain(Connection& replaced, Connection& restored) {
  std::vector<RestoredAccess> all;
  for (const bool station : {false, true}) {
    const char* const sql = station ? "SELECT name, key_hash, revoked, 0 FROM stations"
                                    : "SELECT name, coalesce(password_hash, ''), disabled, role FROM people";
    const auto before = accessRows(replaced, sql);
    if (!before) return before.error();
    const auto now = accessRows(restored, sql);
    if (!now) return now.error();
    for (const auto& [name, row] : *now) {
      const auto found = before->find(name);
      const std::string why = accessEnded(row, found == before->end() ? nullptr : &found->second, station);
      if (!why.empty())
        all.push_back({name, station, std::string(station ? "station " : "user ") + name + ": " + why});
    }
  }
  return all;
}

}  // namespace needlelab
