#include "tests/postgres/isolation/shared_world.h"

#include <sodium.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cstring>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>

#include "common/base/files/files.h"
#include "common/base/text/uuid.h"
#include "common/base/time/clock.h"
#include "db/audit/audit_chain.h"
#include "db/engine/open_postgres.h"
#include "db/login/credentials.h"
#include "db/people/people.h"
#include "db/teaching/documents.h"
#include "tests/unit/db/service/test_service.h"

namespace needlelab::test {
namespace {

template <typename T>
T orThrow(Result<T> result) {
  if (!result) throw std::runtime_error(result.error().message);
  return std::move(*result);
}
void orThrow(const Status& status) {
  if (!status) throw std::runtime_error(status.error().message);
}

/// Replaces libsodium's: keys, salts and pseudonyms are the same for everyone at any time.
const char* constantName() {
  return "constant";
}
std::uint32_t constantNumber() {
  return 0x5a5a5a5a;
}
void constantBytes(void* to, std::size_t count) {
  std::memset(to, 0x5a, count);
}
randombytes_implementation constant_randomness{constantName, constantNumber, nullptr,
                                               nullptr,      constantBytes,  nullptr};

bool isDigit(char c) {
  return std::isdigit(static_cast<unsigned char>(c)) != 0;
}
bool isHexDigit(char c) {
  return std::isxdigit(static_cast<unsigned char>(c)) != 0;
}

/// 2026-11-24 00:01:23, or as much of it as there is; 0: no date begins here.
std::size_t lengthOfDate(std::string_view text) {
  constexpr std::string_view kForm = "dddd-dd-dd dd:dd:dd";
  constexpr std::size_t kDay = 10, kMinute = 16;
  std::size_t same = 0;
  while (same < kForm.size() && same < text.size() &&
         (kForm[same] == 'd' ? isDigit(text[same]) : kForm[same] == text[same]))
    ++same;
  return same == kForm.size() ? same : same >= kMinute ? kMinute : same >= kDay ? kDay : 0;
}

Uuid idOf(const char* text) {
  const auto id = uuidOf(text);
  if (!id) throw std::runtime_error(std::string(text) + ": an id has 16 bytes");
  return *id;
}

constexpr std::uint64_t kChunksOfSession = 3;
constexpr std::size_t kSamplesOfChunk = 60;
constexpr std::int64_t kOlderMade_unix_ns = 1'600'000'000'000'000'000;
constexpr std::int64_t kNewerMade_unix_ns = 1'700'000'000'000'000'000;

std::string databaseOf(const std::string& address) {
  return address.substr(address.rfind('=') + 1);
}

}  // namespace

std::string withoutTimes(const std::string& text) {
  static const std::int64_t began_ns = wallNowNs();
  constexpr std::size_t kDigitsOfTime = 19, kDigitsOfMac = 64;
  std::string kept;
  for (std::size_t at = 0; at < text.size();) {
    std::size_t end = at;
    while (end < text.size() && isHexDigit(text[end])) ++end;
    std::size_t digits = at;
    while (digits < text.size() && isDigit(text[digits])) ++digits;
    const bool begins_word = at == 0 || std::isalnum(static_cast<unsigned char>(text[at - 1])) == 0;
    if (const std::size_t date = begins_word ? lengthOfDate(std::string_view(text).substr(at)) : 0;
        date > 0) {
      kept += "(date)";
      at += date;
    } else if (begins_word && digits - at == kDigitsOfTime && text[at] < '9' &&
               std::stoll(text.substr(at, kDigitsOfTime)) >= began_ns) {
      kept += "(time)";
      at = digits;
    } else if (at > 0 && begins_word && end - at == kDigitsOfMac && text[at - 1] == ':') {
      kept += "(mac)";
      at = end;
    } else {
      const std::size_t next = std::max(end, at + 1);
      kept.append(text, at, next - at);
      at = next;
    }
  }
  return kept;
}

SharedWorld::SharedWorld()
    : address_(folder_.path() / "data" / "needlelab.db", postgresUrlOf(folder_.path() / "data")) {
  if (randombytes_set_implementation(&constant_randomness) != 0)
    throw std::runtime_error("libsodium keeps its random numbers");
  (void)withoutTimes("");
  fill();
  restored_url_ = restoredNow("restored", kNewerMade_unix_ns);
  control_ = std::make_unique<Connection>(orThrow(openPostgres({.url = address_.url})), address_.path);
  const auto tables = orThrow(control_
                                  ->prepare("SELECT tablename::text FROM pg_tables"
                                            " WHERE schemaname = 'needlelab' ORDER BY 1")
                                  .all(firstText));
  // each erasure analyzes all tables; small ones need no statistics
  orThrow(control_->script(
      "DO $$ DECLARE one record; BEGIN FOR one IN SELECT attrelid::regclass AS named, attname FROM "
      "pg_attribute"
      " JOIN pg_class c ON c.oid = attrelid WHERE relnamespace = 'needlelab'::regnamespace AND relkind = 'r'"
      " AND attnum > 0 AND NOT attisdropped LOOP"
      " EXECUTE format('ALTER TABLE %s ALTER %I SET STATISTICS 0', one.named, one.attname);"
      " END LOOP; END $$"));
  orThrow(control_->script("CREATE SCHEMA kept"));
  for (const std::string& table : tables) {
    // an inserted or updated row has its own transaction
    all_stamps_ += (all_stamps_.empty() ? "" : " UNION ALL ") + ("SELECT '" + table) +
                   "', concat(count(*), ' ', max(xmin::text::bigint)) FROM needlelab." + table;
    orThrow(control_->script("CREATE TABLE kept." + table + " AS TABLE needlelab." + table));
    // without generated columns
    columns_[table] =
        orThrow(control_
                    ->query("SELECT string_agg(quote_ident(attname), ', ' ORDER BY attnum) FROM pg_attribute"
                            " WHERE attrelid = ('needlelab.' || ?)::regclass AND attnum > 0"
                            " AND NOT attisdropped AND attgenerated = ''",
                            table)
                    .first(firstText))
            .value_or("");
  }
  rows_ = rowsOf({tables.begin(), tables.end()});
  stamps_ = stampsNow();
  files_ = filesNow();
  connectAnew();
}

void SharedWorld::connectAnew() {
  one_ = std::make_unique<OneServer>(address_);
  other_ = std::make_unique<OneServer>(address_);
}

std::string SharedWorld::restoredNow(const char* folder, std::int64_t made_unix_ns) {
  // so that it is removed at the end
  const std::string address = postgresUrlOf(folder_.path() / folder);
  const std::string name = databaseOf(address);
  {
    const std::string everywhere = address.substr(0, address.rfind('=') + 1) + "postgres";
    Connection control(orThrow(openPostgres({.url = everywhere})), address_.path);
    // the keepers of test databases are connected to both; each drops a database whose connection has ended
    const std::string source = databaseOf(address_.url);
    orThrow(control.script("DROP DATABASE " + name + " WITH (FORCE)"));
    orThrow(control.script("SELECT pg_terminate_backend(pid, 30000) FROM pg_stat_activity WHERE datname = '" +
                           source + "'"));
    orThrow(control.script("CREATE DATABASE " + name + " TEMPLATE " + source));
  }
  Connection restored(orThrow(openPostgres({.url = address})), address_.path);
  const std::string made = std::to_string(made_unix_ns);
  // without the triggers that protect the log
  orThrow(restored.script("SET session_replication_role = replica; UPDATE audit SET unix_ns = " + made +
                          "; INSERT INTO meta (key, value) VALUES ('latest_unix_ns', '" + made +
                          "') ON CONFLICT (key) DO UPDATE SET value = excluded.value"));
  return urlFormOf(address);
}

void SharedWorld::fill() {
  auto store = openStore(folder_.path() / "data");
  const auto ask = [&](const Principal& who, const pb::Request& request) {
    const Outcome outcome = store->service().execute(who, request);
    if (outcome.error) throw std::runtime_error(outcome.error->message);
    return outcome.reply;
  };
  const Principal ada{"ada", pb::ADMINISTRATOR};
  {
    pb::Request request;
    request.mutable_get_profile()->set_id("knee-adult");
    profile_json_ = ask(ada, request).profile().json();
  }
  {
    pb::Request request;
    request.mutable_import_curriculum()->set_json(
        R"({"id":"course","name":"A course","exercises":[)"
        R"({"id":"first","name":"The first","profile_id":"knee-adult"},)"
        R"({"id":"second","name":"The second","profile_id":"knee-adult"}]})");
    ask(ada, request);
  }
  const auto open = [&](Connection& c, const char* id, const char* trainee, const char* exercise,
                        std::uint64_t chunks) -> Status {
    auto d = describe(idOf(id));
    d.set_trainee(trainee);
    d.set_exercise_id(exercise);
    d.set_profile_json(profile_json_);
    if (auto opened = SessionStore(c).open(d, 1); !opened) return opened.error();
    for (std::uint64_t seq = 0; seq < chunks; ++seq) {
      auto appended = SessionStore(c).append(idOf(id), seq, chunkOf(seq, kSamplesOfChunk));
      if (!appended) return appended.error();
    }
    return {};
  };
  orThrow(store->writer().run([&](Connection& c) -> Status {
    constexpr std::pair<const char*, pb::Role> kPeople[] = {
        {"ada", pb::ADMINISTRATOR}, {"abe", pb::ADMINISTRATOR}, {"mia", pb::CURRICULUM_MANAGER},
        {"ina", pb::INSTRUCTOR},    {"rea", pb::RESEARCHER},    {"anna", pb::TRAINEE},
        {"bob", pb::TRAINEE},       {"carl", pb::TRAINEE},      {"cora", pb::TRAINEE}};
    for (const auto& [name, role] : kPeople) {
      // staff have some password; otherwise none of them could log in
      std::string hash = role == pb::TRAINEE ? "" : "$hash";
      RETURN_IF_ERROR(PeopleStore(c).add({name, role, hash, false, 1, std::string("Full ") + name}));
    }
    ASSIGN_OR_RETURN(const auto code, hashCode("4711"));
    RETURN_IF_ERROR(PeopleStore(c).setCodeHash("cora", code));
    for (const char* station : {"station-1", "station-2"})
      RETURN_IF_ERROR(StationStore(c).add(station, StationKeyBytes{}, 1));
    RETURN_IF_ERROR(open(c, kScoredSession, "anna", "first", kChunksOfSession));
    RETURN_IF_ERROR(open(c, kOtherSession, "bob", "first", kChunksOfSession));
    RETURN_IF_ERROR(open(c, kOpenSession, "carl", "first", 2));
    RETURN_IF_ERROR(open(c, kUnknownOpenSession, "somebody", "first", 2));
    RETURN_IF_ERROR(open(c, kWaitingSession, "nobody", "first", kChunksOfSession));
    RETURN_IF_ERROR(open(c, kOldSession, "bob", "second", kChunksOfSession));
    RETURN_IF_ERROR(open(c, kErasedSession, "carl", "first", kChunksOfSession));
    return open(c, kUnsafeSession, "bob", "second", kChunksOfSession);
  }));
  store.reset();
  older_url_ = restoredNow("older", kOlderMade_unix_ns);
  store = openStore(folder_.path() / "data");
  for (const char* id :
       {kScoredSession, kOtherSession, kWaitingSession, kOldSession, kErasedSession, kUnsafeSession})
    orThrow(store->service().scoring().closeSession(closeOf(idOf(id), kChunksOfSession, kSamplesOfChunk),
                                                    "station-1"));
  {
    pb::Request request;
    auto* group = request.mutable_put_group()->mutable_group();
    group->set_id("g1");
    group->set_name("Group one");
    group->add_members("anna");
    group->add_members("bob");
    ask(ada, request);
  }
  {
    pb::Request request;
    request.mutable_assign()->set_trainee("bob");
    request.mutable_assign()->set_exercise_id("first");
    ask(ada, request);
  }
  {
    pb::Request request;
    request.mutable_set_consent()->set_name("anna");
    request.mutable_set_consent()->set_given(true);
    ask(ada, request);
  }
  {
    pb::Request request;
    request.mutable_annotate()->set_session_id(kScoredSession);
    request.mutable_annotate()->set_text("as carl did it");
    ask({"ina", pb::INSTRUCTOR}, request);
  }
  {
    pb::Request request;
    request.mutable_set_retention()->mutable_policy()->set_exercise_id("second");
    request.mutable_set_retention()->mutable_policy()->set_delete_after_days(1);
    ask(ada, request);
  }
  orThrow(store->writer().run([&](Connection& c) -> Status {
    RETURN_IF_ERROR(SessionStore(c).markSafe(idOf(kOldSession), kChunksOfSession));
    // long ago
    for (const char* id : {kOldSession, kUnsafeSession})
      RETURN_IF_ERROR(c.run("UPDATE sessions SET closed_unix_ns = 2 WHERE id = ?", ByteView(idOf(id))));
    RETURN_IF_ERROR(c.run("UPDATE meta SET value = '1' WHERE key = 'created_unix_ns'"));
    // samples not used here: each run reads everything
    for (const char* remove :
         {"DELETE FROM exercises WHERE curriculum_id <> 'course'",
          "DELETE FROM curricula WHERE id <> 'course'", "DELETE FROM profiles WHERE id <> 'knee-adult'"})
      RETURN_IF_ERROR(c.run(remove));
    // with definitions older than the program's
    return c.run("UPDATE scores SET definition_version = 1");
  }));
  pb::Request request;
  request.mutable_export_all();
  const pb::Reply exported = ask(ada, request);
  for (const std::string& text : exported.records().records()) {
    const auto record = nlohmann::json::parse(text);
    if (record["kind"] == "person" && record["name"] == "anna") person_record_ = text;
  }
  if (person_record_.empty()) throw std::runtime_error("the export lacks anna");
}

std::map<std::string, std::string> SharedWorld::stampsNow() {
  std::map<std::string, std::string> stamps;
  auto all = control_->prepare(all_stamps_);
  while (orThrow(all.step())) stamps[all.text(0)] = all.text(1);
  return stamps;
}

std::set<std::string> SharedWorld::changedTables() {
  std::set<std::string> changed;
  for (const auto& [table, stamp] : stampsNow())
    if (stamp != stamps_.at(table)) changed.insert(table);
  return changed;
}

std::map<std::string, std::string> SharedWorld::rowsOf(const std::set<std::string>& tables) {
  std::string select;
  for (const std::string& table : tables) {
    // salts and MACs depend on times; faultOfAuditChain() checks what they prove
    const std::string row = table == "audit_chain" ? "(x.position, x.line, x.key_id)"
                            // a new person's UUID is random
                            : table == "people" ? "(to_jsonb(x) - 'uuid')"
                                                : "x";
    select += (select.empty() ? "" : " UNION ALL ") + ("SELECT '" + table) + "', " + row +
              "::text FROM needlelab." + table + " x";
  }
  std::map<std::string, std::multiset<std::string>> sorted;
  if (!select.empty()) {
    auto all = control_->prepare(select);
    while (orThrow(all.step())) sorted[all.text(0)].insert(withoutTimes(all.text(1)));
  }
  std::map<std::string, std::string> rows;
  for (const std::string& table : tables)
    for (const std::string& row : sorted[table]) rows[table] += row + "\n";
  return rows;
}

std::string SharedWorld::contents(bool with_audit_log) {
  std::string text;
  for (const auto& [table, rows] : rowsOf(changedTables())) {
    const bool is_log = table == "audit" || table == "audit_chain" || table == "last_numbers";
    if ((with_audit_log || !is_log) && rows != rows_[table]) text += "== " + table + "\n" + rows;
  }
  return text;
}

std::map<std::string, Bytes> SharedWorld::filesNow() const {
  std::map<std::string, Bytes> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder_.path() / "data")) {
    if (!entry.is_regular_file()) continue;
    const std::string text = orThrow(readWholeFile(entry.path()));
    files[entry.path().string()] = Bytes(text.begin(), text.end());
  }
  return files;
}

void SharedWorld::putBack() {
  std::string script;
  for (const std::string& table : changedTables()) {
    const std::string& columns = columns_.at(table);
    script += "DELETE FROM needlelab." + table + "; INSERT INTO needlelab." + table + " (" + columns +
              ") SELECT " + columns + " FROM kept." + table + ";";
    bloated_.insert(table);
  }
  if (!script.empty()) {
    // without triggers and foreign keys
    orThrow(control_->script("SET session_replication_role = replica;" + script +
                             "SET session_replication_role = origin"));
    // restored rows leave dead ones, which each statement would read
    constexpr std::uint64_t kVacuumEvery = 16;
    if (++times_put_back_ % kVacuumEvery == 0) {
      for (const std::string& table : bloated_) orThrow(control_->script("VACUUM needlelab." + table));
      bloated_.clear();
    }
    stamps_ = stampsNow();
  }
  const auto files = filesNow();
  for (const auto& [path, bytes] : files)
    if (!files_.contains(path)) std::filesystem::remove(path);
  for (const auto& [path, bytes] : files_) {
    const auto now = files.find(path);
    if (now == files.end() || now->second != bytes) orThrow(writeFileAtomically(path, bytes));
  }
}

std::string SharedWorld::faultOfAuditChain() {
  const std::array keys{orThrow(AuditKey::ofFile(address_.path.parent_path() / kAuditKeyFile))};
  const auto verdict = orThrow(verifyAudit(*control_, keys, {}));
  return verdict.ok() ? "" : verdict.texts.front();
}

std::int64_t SharedWorld::deadlocks() {
  auto row = control_->prepare("SELECT deadlocks FROM pg_stat_database WHERE datname = current_database()");
  return orThrow(row.step()) ? row.integer(0) : 0;
}

}  // namespace needlelab::test
