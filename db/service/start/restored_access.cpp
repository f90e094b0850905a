#include "db/service/start/restored_access.h"

#include <algorithm>
#include <map>
#include <tuple>

#include "common/base/bytes.h"
#include "db/store/connection.h"
#include "needlelab/types.pb.h"

namespace needlelab {
namespace {

/// A person's or a station's row.
struct AccessRow {
  std::string secret;  ///< hash of the password or key
  bool shut = false;
  int role = 0;
  std::string name{};  ///< display name; the key is a person's ref
};

Result<std::map<std::string, AccessRow>> accessRows(Connection& connection, bool stations) {
  std::map<std::string, AccessRow> all;
  auto rows = connection.prepare(stations ? "SELECT name, key_hash, revoked, 0, name FROM stations"
                                          : "SELECT ref, coalesce(password_hash, ''), disabled, role, name"
                                            " FROM accounts");
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, rows.step());
    if (!more) return all;
    all[rows.text(0)] = {std::string(textOf(rows.bytes(1))), rows.integer(2) != 0,
                         static_cast<int>(rows.integer(3)), rows.text(4)};
  }
}

/// Why an access of the restored database was no longer valid in the replaced one; empty: it was valid.
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

Result<std::vector<RestoredAccess>> noteAccessValidAgain(Store& store, const std::filesystem::path& kept) {
  // kFrozen: nothing is written beside it
  ASSIGN_OR_RETURN(auto replaced, Connection::open(kept, {.mode = Connection::Mode::kFrozen}));
  std::vector<RestoredAccess> all;
  {
    ASSIGN_OR_RETURN(auto restored, store.readers().borrow());
    for (const bool station : {false, true}) {
      ASSIGN_OR_RETURN(const auto before, accessRows(replaced, station));
      ASSIGN_OR_RETURN(const auto now, accessRows(*restored, station));
      for (const auto& [name, row] : now) {
        const auto found = before.find(name);
        const std::string why = accessEnded(row, found == before.end() ? nullptr : &found->second, station);
        if (!why.empty())
          all.push_back(
              {row.name, name, station, std::string(station ? "station " : "user ") + row.name + ": " + why});
      }
    }
  }
  std::sort(all.begin(), all.end(), [](const RestoredAccess& a, const RestoredAccess& b) {
    return std::tie(a.station, a.name) < std::tie(b.station, b.name);
  });
  for (const RestoredAccess& one : all)
    RETURN_IF_ERROR(store.service().notes().note(
        "local", "access valid again", one.ref,
        (one.station ? "station " : "user ") + one.ref + one.text.substr(one.text.find(": "))));
  return all;
}

}  // namespace needlelab
