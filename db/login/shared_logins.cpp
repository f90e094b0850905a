#include "db/login/shared_logins.h"

#include <fmt/core.h>

#include "db/store/schema.h"

namespace needlelab {
namespace {

constexpr const char* kLoginKeyId = "login_key_id";

}  // namespace

StoreAddress SharedLogins::sideAddress(StoreAddress address) {
  address.is_side_connection = true;
  return address;
}

Status claimLoginKey(Connection& connection, const LoginKey& key) {
  ASSIGN_OR_RETURN(auto transaction, Transaction::begin(connection, Transaction::Kind::kWrite));
  MetaStore meta(connection);
  ASSIGN_OR_RETURN(const auto known, meta.get(kLoginKeyId));
  if (known && *known != key.labKeyId())
    return Error{
        ErrorCode::kInvalidInput,
        fmt::format(
            "{}: is not the key of the servers that work on this database ({} instead of {}): lock-outs and "
            "tokens of one would not hold at the other. Copy pseudonym.key from another server's folder",
            (connection.path().parent_path() / "pseudonym.key").string(), key.labKeyId(), *known)};
  if (!known) RETURN_IF_ERROR(meta.set(kLoginKeyId, key.labKeyId()));
  return transaction.commit();
}

Status removeSharedLogins(Connection& connection) {
  for (const char* table : {"login_tokens", "login_attempts", "noted_reads"}) {
    // an empty table, the usual case, is not written to
    bool has_rows = false;
    {
      auto row = connection.prepare(fmt::format("SELECT 1 FROM {} LIMIT 1", table));
      ASSIGN_OR_RETURN(has_rows, row.step());
    }
    if (has_rows) RETURN_IF_ERROR(connection.script(fmt::format("DELETE FROM {}", table)));
  }
  return {};
}

}  // namespace needlelab
