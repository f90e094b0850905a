// Objects in a PostgreSQL schema that run without being called: triggers, functions, views, rules, policies.
#include <fmt/core.h>

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "db/store/schema.h"

namespace needlelab {
namespace {

/// Each trigger, function, view, rule and row policy in the schema, with a hash of what it does that is the
/// same in every PostgreSQL version: for functions of the source text, for triggers of the catalogue columns.
/// Views have none, because PostgreSQL does not keep their text. In an unfinished copy (store_copy.h)
/// triggers are off, but no program works with it.
constexpr const char* kPostgresObjects = R"sql(
WITH classes AS (SELECT c.oid, c.relname, c.relkind FROM pg_class c JOIN pg_namespace n ON n.oid = c.relnamespace
 WHERE n.nspname = 'needlelab')
SELECT 'trigger ''' || t.tgname || ''' of ''' || c.relname || '''',
 left(encode(sha256(convert_to(concat_ws('|', t.tgtype,
  CASE WHEN t.tgenabled = 'D' AND EXISTS (SELECT 1 FROM needlelab.meta WHERE key = 'copy_under_way')
   THEN 'O'::"char" ELSE t.tgenabled END, f.nspname || '.' || p.proname,
  encode(t.tgargs, 'hex'), (SELECT string_agg(a.attname::text, ',' ORDER BY a.attname::text COLLATE "C")
   FROM pg_attribute a WHERE a.attrelid = t.tgrelid AND a.attnum = ANY (t.tgattr::int2[])),
  t.tgqual IS NULL), 'UTF8')), 'hex'), 32)
 FROM pg_trigger t JOIN classes c ON c.oid = t.tgrelid JOIN pg_proc p ON p.oid = t.tgfoid
 JOIN pg_namespace f ON f.oid = p.pronamespace WHERE NOT t.tgisinternal
UNION ALL SELECT 'function ''' || p.proname || '(' || pg_get_function_identity_arguments(p.oid) || ')''',
 left(encode(sha256(convert_to(concat_ws('|', p.prosrc, l.lanname, p.prosecdef, p.proconfig::text,
  p.provolatile, p.prorettype::regtype::text), 'UTF8')), 'hex'), 32)
 FROM pg_proc p JOIN pg_language l ON l.oid = p.prolang JOIN pg_namespace n ON n.oid = p.pronamespace
 WHERE n.nspname = 'needlelab'
UNION ALL SELECT 'view ''' || relname || '''', '' FROM classes WHERE relkind IN ('v', 'm', 'f')
UNION ALL SELECT 'rule ''' || r.rulename || ''' of ''' || c.relname || '''', ''
 FROM pg_rewrite r JOIN classes c ON c.oid = r.ev_class WHERE r.rulename <> '_RETURN'
UNION ALL SELECT 'row policy ''' || y.polname || ''' of ''' || c.relname || '''', ''
 FROM pg_policy y JOIN classes c ON c.oid = y.polrelid
)sql";

/// What db/migrations/postgres create, as kPostgresObjects returns it. A test compares the two and prints
/// what it found.
const std::map<std::string, std::string>& madeByMigrations() {
  static const std::map<std::string, std::string> kMade = {
      // clang-format off
    {"function 'hex(bytes bytea)'", "d4a7f23b4e0cd88772436379658a9c4a"},
    {"function 'instr(whole text, part text)'", "1978452d968088c2882ca50aee32eee5"},
    {"function 'max(a bigint, b bigint)'", "5e59bc2273ba105638db71e4894b88ed"},
    {"function 'min(a bigint, b bigint)'", "c63492640b81bd0ff260e77440962465"},
    {"function 'next_number()'", "c2f7f147bf5f44531f3dcff14482eab4"},
    {"function 'people_access()'", "ce89a4e643caab3e89f4b2508a006e70"},
    {"function 'quarantine_ends()'", "59d1bc2ec8f2102b8d7a677faccb9187"},
    {"function 'raise_access(of_what bigint, of_name text, in_a_word text)'", "98eaaf4876b539ef9655be228bad518d"},
    {"function 'sessions_ended()'", "7777e3704c883533a828757dd7ade7cf"},
    {"function 'sessions_opened()'", "944fb8aa9decd7fd04a9f7d77185a636"},
    {"function 'sessions_sum()'", "21bf5840d8c01790d78bdcd90c9acadf"},
    {"function 'stations_access()'", "d405a7d6edc120bfcc30e96c8229aa89"},
    {"function 'step_attempts(of_session bigint, sign bigint)'", "1c7d26e8588a6d41f400675d851519a1"},
    {"function 'tell_access()'", "7fed34f4deb8a6c447f6b6992359bf54"},
    {"function 'unknown_trainees_sum()'", "db83e5246d654639526a2538038b2dd5"},
    {"function 'zeroblob(count bigint)'", "7357ec0045b2a5bfbd1e079afdfac1aa"},
    {"trigger 'access_told' of 'access_numbers'", "ac383f22b24e2fc1513a9cb6ba5f08e0"},
    {"trigger 'annotations_number' of 'annotations'", "984088ce16a6d768b6ed33d85f337f9c"},
    {"trigger 'assignments_number' of 'assignments'", "3c173b76a32878440f6c96bf58b70557"},
    {"trigger 'audit_chain_number' of 'audit_chain'", "4007f35ec90a9b01efcd41a63f1a9485"},
    {"trigger 'audit_number' of 'audit'", "3c173b76a32878440f6c96bf58b70557"},
    {"trigger 'consents_number' of 'consents'", "984088ce16a6d768b6ed33d85f337f9c"},
    {"trigger 'people_access' of 'people'", "6b79336131ee607c2e476b14fc20522e"},
    {"trigger 'people_number' of 'people'", "3c173b76a32878440f6c96bf58b70557"},
    {"trigger 'quarantine_ends' of 'chunks'", "934b6fe1a41557e69e1a6bea220e1a6d"},
    {"trigger 'sessions_ended' of 'sessions'", "d676ac186fd6ebf63c28874690708c0d"},
    {"trigger 'sessions_number' of 'sessions'", "0717319a7b6c24868096a18b16994d16"},
    {"trigger 'sessions_opened' of 'sessions'", "97faa4b6505fafc78b409bd8fa8c5743"},
    {"trigger 'sessions_sum_after_insert' of 'sessions'", "04822801e5cb330390126afa399148f3"},
    {"trigger 'sessions_sum_after_update' of 'sessions'", "257d098ec0c20e171c3397174a6656f6"},
    {"trigger 'sessions_sum_before_delete' of 'sessions'", "dfc1f39c5b10b7649610c462c5d3b811"},
    {"trigger 'sessions_sum_before_update' of 'sessions'", "7c8cb372e397b3ab3f69c1ed431b9fd4"},
    {"trigger 'stations_access' of 'stations'", "6c11c642b4b618f416b3068c93536388"},
    {"trigger 'unknown_trainees_sum_after_change' of 'unknown_trainees'", "fbab27996510b3c457867d5bcf0bed48"},
    {"trigger 'unknown_trainees_sum_before_change' of 'unknown_trainees'", "65df99a4ad5166836d12ad7107cb8d76"},
    {"view 'accounts'", ""},
    {"view 'attempt_shares'", ""},
    {"view 'called'", ""},
    {"view 'names_taken'", ""},
    {"view 'uncounted_sessions'", ""},
      // clang-format on
  };
  return kMade;
}

}  // namespace

Result<std::vector<std::string>> postgresSchemaFaults(Connection& connection, std::size_t most) {
  std::vector<std::string> faults;
  const auto fault = [&](std::string text) {
    if (faults.size() < most) faults.push_back(std::move(text));
  };
  auto missing = madeByMigrations();
  auto rows = connection.prepare(kPostgresObjects);
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, rows.step());
    if (!more) break;
    const std::string what = rows.text(0), hash = rows.text(1);
    const auto known = madeByMigrations().find(what);
    if (known == madeByMigrations().end())
      fault("schema: " + what + " is not needlelab's: somebody put it in");
    else if (known->second != hash)
      fault(fmt::format("schema: {} is not as needlelab makes it: somebody changed it (its hash is {})", what,
                        hash));
    missing.erase(what);
  }
  for (const auto& [what, hash] : missing) fault("schema: " + what + " is missing: somebody removed it");
  return faults;
}

Status requireOwnSchema(Connection& connection) {
  auto row = connection.prepare(
      "SELECT o.what, pg_get_userbyid(o.owner)::text, current_user::text FROM"
      " (SELECT n.oid AS schema, 'the schema' AS what, n.nspowner AS owner FROM pg_namespace n"
      "  UNION ALL SELECT c.relnamespace, 'the table ''' || c.relname || '''', c.relowner FROM pg_class c"
      "   WHERE c.relkind IN ('r', 'p', 'v', 'm', 'f')) o"
      " JOIN pg_namespace n ON n.oid = o.schema"
      " WHERE n.nspname = 'needlelab' AND pg_get_userbyid(o.owner) <> current_user LIMIT 1");
  ASSIGN_OR_RETURN(const bool others, row.step());
  if (!others) return {};
  return Error{ErrorCode::kDenied,
               fmt::format("--store: {} of the schema needlelab belongs to '{}', who could replace what is "
                           "stored there, and not to '{}': look who made it; then ALTER … OWNER TO, or take "
                           "another database",
                           row.text(0), row.text(1), row.text(2))};
}

Status requirePostgresRights(Connection& connection) {
  RETURN_IF_ERROR(requireOwnSchema(connection));
  auto row = connection.prepare(
      "SELECT n.oid IS NULL, has_database_privilege(d.oid, 'CREATE'),"
      " coalesce(has_schema_privilege(n.oid, 'USAGE') AND has_schema_privilege(n.oid, 'CREATE'), false),"
      " coalesce((SELECT min(c.relname::text) FROM pg_class c WHERE c.relnamespace = n.oid AND c.relkind = "
      "'r'"
      "  AND NOT (has_table_privilege(c.oid, 'SELECT') AND has_table_privilege(c.oid, 'INSERT')"
      "   AND has_table_privilege(c.oid, 'UPDATE') AND has_table_privilege(c.oid, 'DELETE'))), ''),"
      " quote_ident(current_user), quote_ident(d.datname),"
      " has_function_privilege('pg_catalog.pg_notify(text, text)', 'EXECUTE')"
      " FROM pg_database d LEFT JOIN pg_namespace n ON n.nspname = 'needlelab'"
      " WHERE d.datname = current_database()");
  ASSIGN_OR_RETURN(const bool there, row.step());
  if (!there) return {};
  const bool has_none = row.integer(0) != 0, may_make = row.integer(1) != 0, may_use = row.integer(2) != 0;
  const bool may_tell = row.integer(6) != 0;
  const std::string table = row.text(3), role = row.text(4), database = row.text(5);
  const auto denied = [&](const std::string& what, const std::string& typed) {
    return Error{
        ErrorCode::kDenied,
        fmt::format("--store: the user {} {}. As an administrator of PostgreSQL: {}", role, what, typed)};
  };
  if (has_none && !may_make)
    return denied(
        "may not make the schema needlelab in the database " + database,
        fmt::format("GRANT CREATE ON DATABASE {} TO {}, or CREATE SCHEMA needlelab AUTHORIZATION {} in "
                    "that database",
                    database, role, role));
  if (!has_none && !may_use)
    return denied("may not use the schema needlelab, which it owns",
                  "GRANT ALL ON SCHEMA needlelab TO " + role);
  if (!table.empty())
    return denied(fmt::format("may not read and change the table needlelab.{}, which it owns", table),
                  "GRANT ALL ON ALL TABLES IN SCHEMA needlelab TO " + role);
  if (!may_tell)
    return denied("may not call pg_notify, which each change of an access does",
                  "GRANT EXECUTE ON FUNCTION pg_catalog.pg_notify(text, text) TO " + role);
  return {};
}

}  // namespace needlelab
