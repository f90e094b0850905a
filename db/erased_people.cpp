// Who was erased: whose a session is that comes later, and who came back with a restored backup.
#include <fmt/core.h>

#include <algorithm>
#include <iterator>
#include <map>
#include <set>
#include <utility>

#include "common/base/local_time.h"
#include "common/base/text.h"
#include "db/audit.h"
#include "db/erasure.h"
#include "db/people.h"
#include "db/person_name.h"
#include "db/unknown_trainees.h"

namespace needlelab {
namespace {

/// Erasures of this database's own log. Those of a list (rememberList) are in the table only: no line of this
/// log is theirs.
constexpr const char* kOwnErasures = "pseudonym IN (SELECT subject FROM audit WHERE action = 'person erase')";

/// Those of the lines' pseudonyms that are names of accounts.
Result<std::set<std::string>> pseudonymsOfAccounts(Connection& connection,
                                                   const std::vector<ErasureLine>& lines) {
  std::set<std::string> pseudonyms, accounts;
  for (const ErasureLine& line : lines) pseudonyms.insert(line.pseudonym);
  auto rows = connection.prepare("SELECT name FROM people");
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, rows.step());
    if (!more) return accounts;
    if (pseudonyms.contains(rows.text(0))) accounts.insert(rows.text(0));
  }
}

}  // namespace

Result<std::optional<ErasureStore::Erased>> ErasureStore::newestErasure(std::string_view name,
                                                                        bool of_an_account) {
  ASSIGN_OR_RETURN(const auto key, keyOfErasedSince(INT64_MIN));
  if (!key || name.empty()) return std::optional<Erased>();
  const auto hash = key->nameHash(name);
  return connection_
      .query(
          "SELECT pseudonym, erased_unix_ns, ?3 || pseudonym IN (SELECT key FROM meta) FROM erasures"
          " WHERE name_hash = ?1 AND (?2 = 0 OR ?3 || pseudonym NOT IN (SELECT key FROM meta))"
          " ORDER BY erased_unix_ns DESC LIMIT 1",
          ByteView(hash), of_an_account, kWithoutAccountKey)
      .first([](const Statement& row) {
        return Erased{row.text(0), row.integer(1), row.integer(2) != 0};
      });
}

Result<std::optional<PseudonymKey>> ErasureStore::keyOfErasedSince(std::int64_t unix_ns) {
  {
    auto any = connection_.query("SELECT 1 FROM erasures WHERE erased_unix_ns >= ? LIMIT 1", unix_ns);
    ASSIGN_OR_RETURN(const bool found, any.step());
    if (!found) return std::optional<PseudonymKey>();
  }
  const auto key = this->key();
  if (!key && key.error().code == ErrorCode::kCorrupt) return std::optional<PseudonymKey>();
  if (!key) return key.error();
  return std::optional(*key);
}

Result<std::optional<std::int64_t>> ErasureStore::accountOf(std::string_view name) {
  return connection_.query("SELECT created_unix_ns FROM people WHERE name = ?", name)
      .first([](const Statement& row) { return row.integer(0); });
}

Result<std::string> ErasureStore::nameNow(const Doer& who, std::int64_t begun_unix_ns) {
  ASSIGN_OR_RETURN(const auto account, accountOf(who.name));
  const bool is_known = who.account_unix_ns != 0;
  if (account && (!is_known || *account == who.account_unix_ns)) return who.name;
  const std::int64_t since_unix_ns = is_known ? who.account_unix_ns : begun_unix_ns;
  ASSIGN_OR_RETURN(const auto key, keyOfErasedSince(since_unix_ns));
  if (!key) return who.name;
  const auto hash = key->nameHash(who.name);
  // the first one: accounts of the same name that came later may have been erased, too
  ASSIGN_OR_RETURN(const auto pseudonym,
                   connection_
                       .query("SELECT pseudonym FROM erasures WHERE name_hash = ?1 AND erased_unix_ns >= ?2"
                              " AND ?3 || pseudonym NOT IN (SELECT key FROM meta)"
                              " ORDER BY erased_unix_ns LIMIT 1",
                              ByteView(hash), since_unix_ns, kWithoutAccountKey)
                       .first(firstText));
  return pseudonym.value_or(who.name);
}

Result<AuditRow> ErasureStore::withoutErased(const AuditRow& line) {
  // they are written after what they tell of, and all about accounts
  const bool comes_later =
      line.action == "access ended" || line.action == "code locked" || line.action == "log-in locked";
  AuditRow without = line;
  for (const std::string& name : namesIn(line)) {
    ErasedNames erased;
    erased.name = name;
    if (name == line.who) {
      ASSIGN_OR_RETURN(erased.in_its_place, nameNow({name, line.account_unix_ns}, line.unix_ns));
      if (erased.in_its_place == name) continue;
    } else {
      ASSIGN_OR_RETURN(const auto account, accountOf(name));
      if (account) continue;
      ASSIGN_OR_RETURN(const auto newest, newestErasure(name, comes_later));
      if (!newest || (!comes_later && newest->unix_ns < line.unix_ns)) continue;
      erased.in_its_place = newest->pseudonym;
      erased.typed = newest->without_account;
    }
    RETURN_IF_ERROR(addOthers(connection_, erased));
    without = withoutNames(without, erased, {});
  }
  return without;
}

Result<std::optional<std::string>> ErasureStore::erasedSince(std::string_view name, std::int64_t unix_ns) {
  ASSIGN_OR_RETURN(const auto erased, newestErasure(name));
  if (!erased || erased->unix_ns < unix_ns) return std::optional<std::string>();
  return std::optional(erased->pseudonym);
}

Result<std::int64_t> ErasureStore::addedAt(std::string_view name, std::int64_t now_unix_ns) {
  ASSIGN_OR_RETURN(const auto erased, newestErasure(name));
  return erased ? std::max(now_unix_ns, erased->unix_ns + 1) : now_unix_ns;
}

Result<ErasureStore::Owner> ErasureStore::ownerOf(std::string_view trainee, std::int64_t started_unix_ns,
                                                  std::int64_t now_unix_ns) {
  if (trainee == kGuestName) return Owner{};
  ASSIGN_OR_RETURN(const auto erased, newestErasure(trainee));
  if (!erased) return Owner{};
  ASSIGN_OR_RETURN(const auto person, PeopleStore(connection_).find(trainee));
  // a name that nobody had is the next one's, who has no account either
  ASSIGN_OR_RETURN(const auto account, newestErasure(trainee, true));
  if (account && (!person || person->created_unix_ns < account->unix_ns))
    return Owner{account->pseudonym, false, erased->pseudonym};
  if (!person) return Owner{std::nullopt, false, erased->pseudonym};
  const bool times_tell = person->created_unix_ns <= now_unix_ns;
  return Owner{std::nullopt, times_tell && started_unix_ns < person->created_unix_ns, erased->pseudonym};
}

Status ErasureStore::emptySession(const Uuid& session, std::int64_t now_unix_ns) {
  RETURN_IF_ERROR(
      connection_.run("UPDATE sessions"
                      " SET state = ?, erased = 1, recording = 3, events = 0, hash = zeroblob(32),"
                      " closed_unix_ns = ? WHERE id = ?",
                      static_cast<int>(pb::SESSION_INTERRUPTED), now_unix_ns, ByteView(session)));
  return connection_.run(
      "INSERT INTO removed_originals (session, removed_unix_ns, deleted_unix_ns,"
      " reason, by_whom, leftover, crcs)"
      " SELECT number, ?1, ?1, 'the data of its person was erased before it came',"
      " 'erasure', 0, zeroblob(0) FROM sessions WHERE id = ?2",
      now_unix_ns, ByteView(session));
}

Result<PseudonymKey> ErasureStore::key() {
  const auto folder = connection_.path().parent_path();
  std::error_code error;
  if (!std::filesystem::exists(folder / "pseudonym.key", error)) {
    ASSIGN_OR_RETURN(const auto lines, readErasures(folder));
    auto row = connection_.prepare("SELECT count(*) FROM erasures");
    RETURN_IF_ERROR(row.step());
    if (!lines.empty() || row.integer(0) != 0)
      return Error{ErrorCode::kCorrupt,
                   (folder / "pseudonym.key").string() +
                       ": is not there, although people were erased: nobody could tell any more who they "
                       "were. Put back the file from where keys are kept (deploy/OPERATIONS.md)"};
  }
  return PseudonymKey::ofFolder(folder);
}

Result<std::vector<ErasureToRepeat>> ErasureStore::toRepeat(const std::filesystem::path& folder) {
  std::vector<ErasureToRepeat> repeat;
  ASSIGN_OR_RETURN(auto lines, readErasures(folder));
  // also erasures in the database
  std::set<std::string> known;
  std::vector<ErasureLine> known_lines;
  auto rows = connection_.query(
      "SELECT pseudonym, name_hash, erased_unix_ns, ?1 || pseudonym IN (SELECT key FROM meta) FROM erasures",
      kWithoutAccountKey);
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, rows.step());
    if (!more) break;
    ErasureLine line{rows.text(0), {}, rows.integer(2)};
    line.without_account = rows.integer(3) != 0;
    const auto hash = rows.bytes(1);
    if (hash.size() != line.name_hash.size()) continue;
    std::copy(hash.begin(), hash.end(), line.name_hash.begin());
    known.insert(line.pseudonym);
    known_lines.push_back(std::move(line));
  }
  std::erase_if(lines, [&](const ErasureLine& line) { return known.contains(line.pseudonym); });
  if (lines.empty() && known_lines.empty()) return repeat;
  ASSIGN_OR_RETURN(const auto key, this->key());
  dropFaulty(lines, key);
  lines.insert(lines.end(), std::move_iterator(known_lines.begin()), std::move_iterator(known_lines.end()));
  // the sessions would become that account's
  ASSIGN_OR_RETURN(const auto accounts, pseudonymsOfAccounts(connection_, lines));
  std::erase_if(lines, [&](const ErasureLine& line) { return accounts.contains(line.pseudonym); });
  // an account's first: what it takes, the other one no longer finds, and the name stays the erased person's
  std::stable_partition(lines.begin(), lines.end(),
                        [](const ErasureLine& line) { return !line.without_account; });
  std::multimap<PseudonymKey::Hash, const ErasureLine*> by_hash;
  for (const ErasureLine& line : lines) by_hash.emplace(line.name_hash, &line);
  // of each name the first trace that is not a session that waits; its account; its first session
  auto names = connection_.prepare(fmt::format(
      "SELECT name, min(CASE WHEN waits = 1 THEN NULL ELSE made END), min(account), min(received) FROM"
      " (SELECT name, created_unix_ns AS made, 0 AS waits, created_unix_ns AS account,"
      " NULL AS received FROM people"
      // those of an account are as new as it: the clock may have been ahead when it was added
      " UNION ALL SELECT s.trainee, max(s.received_unix_ns, coalesce(p.created_unix_ns, 0)),"
      " CASE WHEN s.number IN {} THEN 1 ELSE 0 END, NULL, s.received_unix_ns"
      " FROM sessions s LEFT JOIN people p ON p.name = s.trainee WHERE s.erased = 0"
      " UNION ALL SELECT u.given, s.received_unix_ns, CASE WHEN u.by_whom IS NULL THEN 1 ELSE 0 END, NULL, "
      "s.received_unix_ns"
      " FROM unknown_trainees u JOIN sessions s ON s.number = u.session) AS traces"
      " GROUP BY name",
      kWaitingSessions));
  for (;;) {
    ASSIGN_OR_RETURN(const bool more, names.step());
    if (!more) return repeat;
    const auto [first, end] = by_hash.equal_range(key.nameHash(names.text(0)));
    for (auto one = first; one != end; ++one) {
      const ErasureLine& line = *one->second;
      // a person created later with the same name is another person, whom no erasure takes; nor does that of
      // a name that nobody had take what came later, or an account of before
      const bool restored = !known.contains(line.pseudonym);
      const bool is_newer = !names.isNull(2) && names.integer(2) > line.unix_ns;
      const bool came_before = !names.isNull(3) && names.integer(3) <= line.unix_ns;
      // an erasure that this database knows left sessions that wait, and other guests come after it, whatever
      // the clock says
      const bool left_here = names.text(0) == kGuestName || names.isNull(1) ||
                             names.integer(1) > line.unix_ns || (line.without_account && !names.isNull(2));
      const bool before = !restored              ? !left_here
                          : line.without_account ? came_before && (names.isNull(2) || is_newer)
                                                 : !is_newer;
      if (before) repeat.push_back({names.text(0), line, restored});
    }
  }
}

Status ErasureStore::remember(const ErasureLine& line, const std::string& by, const std::string& reason) {
  RETURN_IF_ERROR(
      connection_.run("INSERT INTO erasures (pseudonym, name_hash, erased_unix_ns, by_whom, reason)"
                      " VALUES (?,?,?,?,?) ON CONFLICT (pseudonym) DO UPDATE"
                      " SET erased_unix_ns = excluded.erased_unix_ns",
                      line.pseudonym, ByteView(line.name_hash), line.unix_ns, by, reason));
  for (const auto& [key, is_so] :
       {std::pair{kWithoutAccountKey, line.without_account}, std::pair{kWithWaitingKey, line.with_waiting}})
    RETURN_IF_ERROR(
        connection_.run(is_so ? "INSERT INTO meta (key, value) VALUES (?, '') ON CONFLICT (key) DO NOTHING"
                              : "DELETE FROM meta WHERE key = ?",
                        std::string(key) + line.pseudonym));
  return {};
}

Status ErasureStore::completeList(const std::filesystem::path& folder) {
  ASSIGN_OR_RETURN(
      auto lines,
      connection_
          .query(
              fmt::format("SELECT pseudonym, name_hash, erased_unix_ns, ?1 || pseudonym IN (SELECT key FROM"
                          " meta), ?2 || pseudonym IN (SELECT key FROM meta) FROM erasures WHERE {}",
                          kOwnErasures),
              kWithoutAccountKey, kWithWaitingKey)
          .all([](const Statement& row) {
            ErasureLine line{row.text(0), {}, row.integer(2), row.integer(4) != 0};
            const auto hash = row.bytes(1);
            std::copy_n(hash.begin(), std::min(hash.size(), line.name_hash.size()), line.name_hash.begin());
            line.without_account = row.integer(3) != 0;
            return line;
          }));
  ASSIGN_OR_RETURN(const auto listed, readErasures(folder));
  std::set<std::string_view> known;
  for (const ErasureLine& line : listed) known.insert(line.pseudonym);
  std::erase_if(lines, [&](const ErasureLine& line) { return known.contains(line.pseudonym); });
  if (lines.empty()) return {};
  ASSIGN_OR_RETURN(const auto key, this->key());
  for (ErasureLine& line : lines) line = sealed(std::move(line), key);
  return addErasures(folder, lines, kErasuresFile, &key);
}

Status ErasureStore::rememberList(const std::filesystem::path& folder, const std::set<std::string>& stay,
                                  std::int64_t now_unix_ns) {
  ASSIGN_OR_RETURN(auto lines, readErasures(folder));
  if (lines.empty()) return {};
  ASSIGN_OR_RETURN(const auto key, this->key());
  dropFaulty(lines, key);
  ASSIGN_OR_RETURN(auto passed, pseudonymsOfAccounts(connection_, lines));
  passed.insert(stay.begin(), stay.end());
  ASSIGN_OR_RETURN(const auto known, connection_.prepare("SELECT pseudonym FROM erasures").all(firstText));
  passed.insert(known.begin(), known.end());
  std::erase_if(lines, [&](const ErasureLine& line) { return passed.contains(line.pseudonym); });
  if (lines.empty()) return {};
  std::map<PseudonymKey::Hash, std::string> accounts;
  ASSIGN_OR_RETURN(const auto names, connection_.prepare("SELECT name FROM people").all(firstText));
  for (const std::string& name : names) accounts.emplace(key.nameHash(name), name);
  for (const ErasureLine& line : lines) {
    RETURN_IF_ERROR(remember(line, kServerName, "from the list beside the database"));
    const auto account = accounts.find(line.name_hash);
    if (account == accounts.end() || line.without_account) continue;
    RETURN_IF_ERROR(AuditStore(connection_)
                        .add({0, now_unix_ns, kServerName, "person erase", account->second,
                              fmt::format("not repeated: who had this name was erased on {}, and the account "
                                          "says that it is newer. If it is the same person, erase it",
                                          localTime(line.unix_ns, TimeForm::kZoned))}));
  }
  return {};
}

Result<std::vector<std::string>> ErasureStore::listFaults(const std::filesystem::path& folder) {
  // before the list, into which an erasure writes first
  ASSIGN_OR_RETURN(
      auto lacked,
      connection_
          .prepare(fmt::format("SELECT pseudonym FROM erasures WHERE {} ORDER BY pseudonym", kOwnErasures))
          .all(firstText));
  ASSIGN_OR_RETURN(const auto lines, readErasures(folder));
  std::set<std::string_view> listed;
  for (const ErasureLine& line : lines) listed.insert(line.pseudonym);
  std::erase_if(lacked, [&](const std::string& pseudonym) { return listed.contains(pseudonym); });
  std::vector<std::string> faults;
  if (!lacked.empty())
    faults.push_back(
        fmt::format("{}: lacks {} erasures that the database has, such as {}: after a restore of an older "
                    "backup these people "
                    "would be back. Put the file back, e.g. from {} beside a backup",
                    (folder / kErasuresFile).string(), lacked.size(), lacked.front(), kErasuresCopy));
  if (lines.empty()) return faults;
  ASSIGN_OR_RETURN(const auto key, this->key());
  auto wrong = erasureListFaults(folder / kErasuresFile, lines, key);
  std::move(wrong.begin(), wrong.end(), std::back_inserter(faults));
  ASSIGN_OR_RETURN(const auto accounts, pseudonymsOfAccounts(connection_, lines));
  for (const std::string& name : accounts)
    faults.push_back(fmt::format(
        "{}: the pseudonym of a line, '{}', is the name of an account: the line is not obeyed, because the "
        "erased person's sessions would become that account's. Remove the line, or erase the account",
        (folder / kErasuresFile).string(), printable(name)));
  return faults;
}

std::string erasureToRepeatText(const ErasureToRepeat& erasure) {
  return "'" + erasure.name + "' was erased on " + localTime(erasure.line.unix_ns, TimeForm::kZoned) +
         " and is in this database again, because a backup or an export from before came back: erase it "
         "again by "
         "needlelab-admin person "
         "erase '" +
         erasure.name + "' --confirm '" + erasure.name + "'";
}

}  // namespace needlelab
