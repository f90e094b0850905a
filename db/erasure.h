/// Erases a person's data: deletes a part, keeps a part under a pseudonym, and recognises an older backup.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/base/result.h"
#include "common/base/uuid.h"
#include "db/connection.h"
#include "db/erasure_list.h"
#include "db/pseudonyms.h"
#include "needlelab/teaching.pb.h"
#include "needlelab/types.pb.h"

namespace needlelab {

/// An erased person who is in the database again, because a backup from before the erasure was restored.
struct ErasureToRepeat {
  std::string name;  ///< of the person
  ErasureLine line;
  bool restored = false;  ///< the database does not know of the erasure: it is from before
};
/// "'anna' was erased on … and is in this database again, …: needlelab-admin person erase anna": for display.
std::string erasureToRepeatText(const ErasureToRepeat& erasure);

/// The names of a person who is erased, and the sessions that go, as they were at one time.
struct PersonTraces {
  ErasedNames names;
  std::set<std::int64_t> sessions;    ///< numbers: remarks on them are about the person
  std::set<std::string> session_ids;  ///< of those that the erasure takes, as the audit log has them
  /// The newest rows at that time: all later ones have greater numbers.
  std::int64_t last_session = 0, last_remark = 0, last_line = 0;
  /// Whether what was replaced by these in rows of that time is all that `now` asks for.
  [[nodiscard]] bool hasAllOf(const PersonTraces& now) const;
};

/// What was replaced, in rows.
struct ReplacedWords {
  std::size_t remarks = 0, lines = 0;  ///< all of them
  std::size_t remarks_of_others = 0, groups = 0, lines_about_others = 0;
  /// Of those that are not about the person, for the administrator; empty: there are none.
  [[nodiscard]] std::string text() const;
};

/// Where remarks and lines of the audit log have a person's names (ErasureStore::lookForNames), and what of
/// the erasure is done before its transaction.
struct FoundNames {
  /// Rows by their numbers: above `after`, up to `last`. At most as many as one commit writes (text_pages.h).
  struct Page {
    bool is_audit = false;
    std::int64_t after = 0, last = 0;
  };
  PersonTraces who;
  std::vector<Page> pages;  ///< those with names
  /// Lines of the log that say the person's full names: they are the transaction's.
  std::vector<std::int64_t> later_lines;
  std::uint64_t bytes = 0;  ///< of the rows in them that have a name
  ReplacedWords replaced;   ///< by replaceNames() so far
  pb::Erasure sessions;     ///< what eraseSomeSessions() erased so far: its counts only
};

/// What an erasure's transaction did.
struct ErasedRows {
  pb::Erasure erasure;                 ///< without `text`
  ErasedNames names;                   ///< to look for: `typed` is not set
  bool typed = false;                  ///< nobody had the name: it stays in texts about others
  std::set<std::string> session_ids;   ///< as the audit log has them
  std::vector<std::string> group_ids;  ///< with the name: they stay
  ReplacedWords replaced;
};

/// Does not own the connection. Thread: as its Connection; changes need the writer's and a transaction.
class ErasureStore {
 public:
  /// What an erasure leaves free: for the changed pages that are still in the writer's memory (16 MiB), and
  /// for the rows until the next look.
  static constexpr std::uint64_t kRoomLeft_bytes = 32 << 20;
  /// Bytes that are free on the database's disk; nothing: nobody can tell.
  using FreeRoom = std::function<std::optional<std::uint64_t>()>;
  /// `free_room`: for tests; empty: the disk's own.
  explicit ErasureStore(Connection& connection, FreeRoom free_room = {})
      : connection_(connection), free_room_(std::move(free_room)) {}

  /// The key beside the database; created when missing. kCorrupt: the key is missing although people were
  /// erased. A new key could not identify them.
  Result<PseudonymKey> key();
  /// Open sessions that an erasure would take now, as "… at station …".
  Result<std::vector<std::string>> openSessions(std::string_view name, bool with_waiting = false);
  /// The time of an erasure of this name that begins now: now, or the time of what it takes, if the clock was
  /// ahead then. So all that is newer by its time came later, also where only the line tells of the erasure.
  Result<std::int64_t> erasedAt(std::string_view name, std::int64_t now_unix_ns);
  /// In one transaction (db/README.md, "An erasure"). Sessions keep their rows, closed, under the pseudonym,
  /// without score, events and attempts' verdicts. Retention removes their chunks later
  /// (RetentionStore::leftovers). Sessions that wait for a manager under the name of an account stay as they
  /// are, unless `with_waiting`: they may be another person's. A line `without_account` takes no account, and
  /// only sessions that came up to its time: of those under the name of a newer account those that wait,
  /// under the name of an older one none; texts about others stay. `text` of the reply: places that still
  /// have the name. Free parts of pages may have it until they are cleared (free_parts.h, kFreePartsKey).
  /// kNotFound: the name has neither a person nor sessions that go; kDenied: the last administrator who can
  /// log in; kNoRoom: the disk would have become full. Then the transaction is sound and must be undone.
  Result<pb::Erasure> erase(const std::string& name, const ErasureLine& line, const std::string& by,
                            const std::string& reason, std::int64_t now_unix_ns, bool with_waiting = false);

  // The same in steps, for a server: what grows with the texts of all people, or with the person's sessions,
  // is no part of the transaction. First lookForNames(); then replaceNames() for each page, each in a commit
  // of its own; then eraseSomeSessions() until there are few, each in a commit; then eraseRows() in one; then
  // reportOf(). Until eraseRows() is committed the person is not erased: whoever stops before it begins anew,
  // and a program that was killed repeats the erasure at its next start.

  /// Looks for the person in the remarks and the audit log that are there now. Any connection; no view of the
  /// database is held between the pages. Errors as erase(); kNoRoom: for what was found.
  Result<FoundNames> lookForNames(const std::string& name, const ErasureLine& line, bool with_waiting);
  /// Replaces the names in one of the pages found: some 50 ms. In a transaction. kNoRoom.
  Status replaceNames(FoundNames& found, const FoundNames::Page& page);
  /// Erases the first of the person's sessions, kBytesOfPage of what stations and scores wrote to them (or
  /// one session): the commit writes it anew, and the writer's memory holds it. False: nothing was done, no
  /// more is left than that, and the transaction takes it. In a transaction; errors as erase().
  Result<bool> eraseSomeSessions(const std::string& name, const ErasureLine& line, const std::string& by,
                                 std::int64_t now_unix_ns, bool with_waiting, FoundNames& found);
  /// All the rest. Of remarks and lines it looks only at those that came after `found`, but at all where the
  /// person got another full name or other sessions since; null: nothing was replaced before. In a
  /// transaction; errors as erase().
  Result<ErasedRows> eraseRows(const std::string& name, const ErasureLine& line, const std::string& by,
                               const std::string& reason, std::int64_t now_unix_ns, bool with_waiting,
                               const FoundNames* found = nullptr);
  /// What is left, for `text` of the reply. Any connection.
  Result<std::string> reportOf(const ErasedRows& done);

  /// When an account of this name that is added now was made: now; or just after the newest erasure of the
  /// name, if the clock was ahead then. So the times of both tell which came first.
  Result<std::int64_t> addedAt(std::string_view name, std::int64_t now_unix_ns);
  /// Whose a session is that a station delivers.
  struct Owner {
    std::optional<std::string> pseudonym;  ///< of an erased person: nothing of the session is kept
    bool may_be_erased = false;  ///< the account's, or of the erased person of its name: a manager decides
    /// Of whoever of the name was erased last, also where the session is not theirs.
    std::optional<std::string> namesake = {};
  };
  /// Of a session that a station delivers now under this name. Where an account of the name was erased and
  /// none was added since, it is the erased person's, whatever the station's clock says. Under a name that
  /// was erased while nobody had it, it is kept and waits: it may be another's. The session of an account is
  /// always kept; if it says that it began before the account, it may be the erased person's, unless the
  /// server's clock has not reached the account's time (addedAt). kGuestName is nobody: its sessions are
  /// always kept, because no account tells those of before from those of after. Without the key it is
  /// nobody's of them: sessions are stored in any case, and `check` reports the missing key.
  Result<Owner> ownerOf(std::string_view trainee, std::int64_t started_unix_ns, std::int64_t now_unix_ns);
  /// The pseudonym of the person with this name who was erased at `unix_ns` or later. Nothing: as above.
  Result<std::optional<std::string>> erasedSince(std::string_view name, std::int64_t unix_ns);
  // What is written by work that was under way during an erasure: ask in the transaction that writes it.

  /// The name that may be stored of who does something: the pseudonym, if the account is no more and was
  /// erased since it was made or, where nobody knows when, since the work was begun. Without the key, the
  /// name: `check` reports it.
  Result<std::string> nameNow(const Doer& who, std::int64_t begun_unix_ns);
  /// A line of the audit log without those of namesIn() who were erased since `line.unix_ns`, when it was
  /// begun; its doer as nameNow(). Of others a name that somebody has again stays: it may be that account's.
  Result<AuditRow> withoutErased(const AuditRow& line);
  /// For a session without chunks that a station opened for an erased person: closes and marks it, so that it
  /// stays empty.
  Status emptySession(const Uuid& session, std::int64_t now_unix_ns);
  /// Erased people, by DIR/erasures or by this database, who are in the database again: from a restored
  /// backup. Sessions that an erasure here left waiting are not theirs. By a
  /// line that the database does not know, an account is theirs unless it is newer, and what came under a
  /// name that nobody had, if it is not. Lines that listFaults() tells are not obeyed. Empty when all is
  /// well. kCorrupt: as key().
  Result<std::vector<ErasureToRepeat>> toRepeat(const std::filesystem::path& folder);
  /// Puts the lines of DIR/erasures that this database does not know into it, but not those of the pseudonyms
  /// `stay`: who comes under such a name from now on is not from before the erasure. An account that such a
  /// line names is newer (toRepeat): the audit log says so, because a clock may have been wrong. Lines that
  /// listFaults() tells are passed over. In a transaction. kCorrupt: as key().
  Status rememberList(const std::filesystem::path& folder, const std::set<std::string>& stay,
                      std::int64_t now_unix_ns);
  /// Adds to DIR/erasures the erasures of this database's own log that it lacks: another server erased them,
  /// with a list in its own folder. Their hashes must be of the folder's key. kCorrupt: as key().
  Status completeList(const std::filesystem::path& folder);
  /// Lines of DIR/erasures that another key made, or that were changed, and erasures of this database's own
  /// log that it lacks, for display; empty when all is well. kCorrupt: as key().
  Result<std::vector<std::string>> listFaults(const std::filesystem::path& folder);

 private:
  struct Erased {
    std::string pseudonym;
    std::int64_t unix_ns = 0;
    bool without_account = false;
  };
  /// Sessions of a person, as eraseSessions() needs them.
  struct OwnSession {
    std::int64_t number = 0;
    pb::SessionState state = pb::SESSION_OPEN;
    int recording = 1;
    std::uint64_t chunks = 0;
    std::string description;
  };
  struct OwnSessions {
    std::vector<OwnSession> sessions;
    bool more = false;  ///< than these
  };
  struct GroupWithName {
    std::string id, name, name_after;
    bool id_has_name = false;
  };
  /// Rows with a name, counted, and the first of them for display.
  struct Counted {
    std::size_t count = 0;
    std::string some;
    void add(const std::string& which);
  };
  /// Sessions whose stations wrote a name: as a whole word, in sessions of others; only its letters, or in an
  /// erased session.
  struct SessionsWithName {
    Counted of_others, perhaps;
  };
  /// Called after each row that is written. kNoRoom as requireRoom(), which it asks now and then.
  Status noteRow();
  /// kNoRoom unless the disk has room to write `bytes` more, to commit and to empty the log. SQLite itself
  /// must not find it full: that would end the server.
  Status requireRoom(std::uint64_t bytes = 0);
  /// 0 on PostgreSQL.
  Result<std::uint64_t> pragma(std::string_view name);
  /// kNotFound, kDenied as erase().
  Status mayErase(const std::string& name, const ErasureLine& line, bool with_waiting);
  /// The person's names, but for `others`, and sessions. `before`: to read only the later lines of the log.
  Result<PersonTraces> tracesOf(const std::string& name, const ErasureLine& line, bool with_waiting,
                                const PersonTraces* before);
  /// Removes what only an account has, and replaces the person as who did something.
  Status eraseAccount(const ErasedNames& names);
  Status eraseDoers(const ErasedNames& names);
  /// The key, if anybody was erased since then. Nothing: nobody was, or the key is missing.
  Result<std::optional<PseudonymKey>> keyOfErasedSince(std::int64_t unix_ns);
  /// When the account with this name was made; nothing: there is none.
  Result<std::optional<std::int64_t>> accountOf(std::string_view name);
  /// The newest erasure of the name, or the newest one `of_an_account`.
  Result<std::optional<Erased>> newestErasure(std::string_view name, bool of_an_account = false);
  /// Puts the erasure into the database, or makes it newer.
  Status remember(const ErasureLine& line, const std::string& by, const std::string& reason);
  /// The sessions that an erasure takes now, in their order, until they have so many bytes.
  Result<OwnSessions> sessionsToErase(const std::string& name, const ErasureLine& line, bool with_waiting,
                                      std::uint64_t most_bytes);
  /// Adds what it erased to the counts.
  Status eraseSessions(const std::vector<OwnSession>& sessions, const ErasedNames& names,
                       std::int64_t now_unix_ns, const std::string& by, pb::Erasure& erasure);
  /// In rows whose numbers are above `after` and up to `last`.
  Status replaceInRemarks(const PersonTraces& who, std::int64_t after, std::int64_t last,
                          ReplacedWords& replaced);
  Status replaceInLines(const PersonTraces& who, std::int64_t after, std::int64_t last,
                        ReplacedWords& replaced, bool with_full_names = true);
  /// Groups whose name or id has the person's name. `names`: without `others`.
  Result<std::vector<GroupWithName>> groupsWith(ErasedNames names);
  /// Replaces the person in the names of groups. Returns the ids that have the name: they stay, because
  /// assignments and addresses refer to them.
  Result<std::vector<std::string>> eraseInGroups(const ErasedNames& names, ReplacedWords& replaced);
  /// Where the name is left, for the administrator; empty: nowhere.
  Result<std::string> leftOver(const ErasedNames& names, const std::vector<std::string>& group_ids,
                               const SessionsWithName& sessions);
  /// Sessions under names that nobody has, in which a plain search finds a name of this person: each name
  /// with how many, for the administrator; empty: none.
  Result<std::string> sessionsAlike(const ErasedNames& names);
  /// Texts that the name may still be in, by a plain search, for the administrator to look at; empty: none.
  Result<std::string> perhapsLeft(const NameSearch& search, const SessionsWithName& sessions);
  /// The search for perhapsLeft(): of others' names, only accounts' stay.
  Result<NameSearch> plainSearch(ErasedNames names);
  /// Looks at what stations wrote with all sessions.
  Result<SessionsWithName> sessionsWithName(const ErasedNames& names, const NameSearch& search);
  /// Rows whose author has the name, where that is not replaced, for the administrator; empty: none.
  Result<std::string> doneUnder(const std::string& name);
  /// Rows whose author, but for those of remarks, is not `name` and has the letters of one of the names
  /// ("local:anna"), for the administrator; empty: none.
  Result<std::string> doersAlike(const NameSearch& search, const std::string& name);
  Connection& connection_;
  FreeRoom free_room_;
  int rows_ = 0;  ///< that were written since requireRoom()
};

/// Key of `meta`, and behind it the pseudonym: the erasure was of a name that nobody had.
inline constexpr std::string_view kWithoutAccountKey = "erased_without_account ";
/// The same for one that took the sessions that waited for a manager, too.
inline constexpr std::string_view kWithWaitingKey = "erased_with_waiting ";

/// Key of `meta`, and behind it the pseudonym: nobody has looked yet which files still hold the person. Set
/// in the erasure's transaction to ErasureLine::unix_ns, in digits (db/service/unseen_files.h).
inline constexpr std::string_view kFilesUnseenKey = "files_unseen ";

/// The profile of an erased person's session. A station sends the profile with the session, and a name may
/// stand anywhere in its texts; nothing reads it once the recording is gone. The session keeps its
/// revision, and its id without the person's names (session_words.h).
inline constexpr std::string_view kErasedProfile = "{}";

}  // namespace needlelab
