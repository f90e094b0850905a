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
  /// Open sessions that `erase` would take, as "… at station …".
  Result<std::vector<std::string>> openSessions(std::string_view name, bool with_waiting = false);
  /// In one transaction (db/README.md, "An erasure"). Sessions keep their rows, closed, under the pseudonym,
  /// without score, events and attempts' verdicts. Retention removes their chunks later
  /// (RetentionStore::leftovers). Sessions that wait for a manager under the name of an account stay as they
  /// are, unless `with_waiting`: they may be another person's. `text` of the reply: places that still have
  /// the name. Free parts of pages may have it until they are cleared (free_parts.h, kFreePartsKey).
  /// kNotFound: the name has neither a person nor sessions; kDenied: the last administrator who can
  /// log in; kNoRoom: the disk would have become full. Then the transaction is sound and must be undone.
  Result<pb::Erasure> erase(const std::string& name, const ErasureLine& line, const std::string& by,
                            const std::string& reason, std::int64_t now_unix_ns, bool with_waiting = false);

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
  /// For a session without chunks that a station opened for an erased person: closes and marks it, so that it
  /// stays empty.
  Status emptySession(const Uuid& session, std::int64_t now_unix_ns);
  /// Erased people, by DIR/erasures or by this database, who are in the database again: from a restored
  /// backup or from imported older records. Sessions that an erasure here left waiting are not theirs. Lines
  /// that listFaults() tells are not obeyed. Empty when all is well. kCorrupt: as key().
  Result<std::vector<ErasureToRepeat>> toRepeat(const std::filesystem::path& folder);
  /// Puts the lines of DIR/erasures that this database does not know into it, but not those of the pseudonyms
  /// `stay`: who comes under such a name from now on is not from before the erasure. Lines that listFaults()
  /// tells are passed over. In a transaction. kCorrupt: as key().
  Status rememberList(const std::filesystem::path& folder, const std::set<std::string>& stay);
  /// Lines of DIR/erasures that another key made, or that were changed, for display; empty when all is well.
  /// kCorrupt: as key().
  Result<std::vector<std::string>> listFaults(const std::filesystem::path& folder);

 private:
  struct Erased {
    std::string pseudonym;
    std::int64_t unix_ns = 0;
  };
  /// What was replaced in texts that are not about the person.
  struct Elsewhere {
    std::size_t remarks = 0, groups = 0, audit_lines = 0;
    /// For the administrator; empty: nothing was.
    [[nodiscard]] std::string text() const;
  };
  /// Called after each row that is written. kNoRoom as requireRoom(), which it asks now and then.
  Status noteRow();
  /// kNoRoom unless the disk has room to write `bytes` more, to commit and to empty the log. SQLite itself
  /// must not find it full: that would end the server.
  Status requireRoom(std::uint64_t bytes = 0);
  /// Replaces the person as who did something.
  Status eraseDoers(const ErasedNames& names);
  /// The newest erasure of the name, or the newest one `of_an_account`.
  Result<std::optional<Erased>> newestErasure(std::string_view name, bool of_an_account = false);
  /// Puts the erasure into the database, or makes it newer; `without_account`: nobody had the name.
  Status remember(const ErasureLine& line, bool without_account, const std::string& by,
                  const std::string& reason);
  Status eraseSessions(const ErasedNames& names, bool with_waiting, std::int64_t now_unix_ns,
                       const std::string& by, std::set<std::string>& ids, pb::Erasure& erasure);
  Status eraseRemarks(const ErasedNames& names, Elsewhere& elsewhere);
  /// Replaces the person in the names of groups. Returns the ids that have the name: they stay, because
  /// assignments and addresses refer to them. `names`: without `others`.
  Result<std::vector<std::string>> eraseInGroups(ErasedNames names, Elsewhere& elsewhere);
  /// Where the name is left, for the administrator; empty: nowhere.
  Result<std::string> leftOver(const ErasedNames& names, const std::vector<std::string>& group_ids);
  /// Sessions under names that nobody has, in which a plain search finds a name of this person: each name
  /// with how many, for the administrator; empty: none.
  Result<std::string> sessionsAlike(const ErasedNames& names);
  /// Texts that the name may still be in, by a plain search, for the administrator to look at; empty: none.
  Result<std::string> perhapsLeft(const ErasedNames& names);
  Status eraseWords(const ErasedNames& names, const std::set<std::string>& sessions, pb::Erasure& erasure,
                    Elsewhere& elsewhere);
  Connection& connection_;
  FreeRoom free_room_;
  int rows_ = 0;  ///< that were written since requireRoom()
};

/// Key of `meta`, and behind it the pseudonym: the erasure was of a name that nobody had.
inline constexpr std::string_view kWithoutAccountKey = "erased_without_account ";

/// The profile of an erased person's session. A station sends the profile with the session, and a name may
/// stand anywhere in its texts; nothing reads it once the recording is gone. The session keeps its id and
/// revision.
inline constexpr std::string_view kErasedProfile = "{}";

/// Clears what a station wrote in words of its own about the device and how it renders. A station may put a
/// name there.
void clearDeviceWords(pb::SessionDescription& description);

}  // namespace needlelab
