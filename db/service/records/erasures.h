/// Erasing a person while the server runs, and completing erasures at start-up.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>

#include "common/base/result.h"
#include "db/service/context/context.h"
#include "db/service/records/retention.h"
#include "db/sessions/db_writer.h"
#include "db/store/connection.h"
#include "db/store/store_address.h"
#include "needlelab/control.pb.h"

namespace needlelab {

/// How many pieces of an erased person's chunks (RetentionPace) one step removes: about 0.3 s, during which
/// an import or a backup waits. Smaller: more checks of what is left; greater: longer waits.
inline constexpr std::size_t kErasedPiecesAtOnce = 8;

/// The person is erased. Remaining steps: remove the chunks, then empty the log.
struct ErasureUnderWay {
  pb::Reply reply;
  LeftoversSoFar chunks;
  std::string text_on_chunks;  ///< about chunks that stay; empty: none do
};

/// Makes DIR/erasures and the database agree: erases people on the list whom a restored backup brought back,
/// and adds people whom another server erased to the list. Returns the number of erasures. Call before
/// anything is served, or with Duty::kErasure. Needs the writer's connection, outside a transaction. Errors:
/// as ErasureStore::erase().
Result<std::size_t> agreeOnErasures(Connection& writer, std::int64_t now_unix_ns);
/// Only adds to the list; any connection.
Status completeErasures(Connection& connection);
/// Adds the list to the one in the backup folder, for a restore on another machine; empty: no such folder.
Status writeErasuresNextToBackups(Connection& connection, const std::filesystem::path& backups);

/// The folder of the last backup; empty: none was made, or the folder is not available now (a stick).
std::filesystem::path backupsFolder(Connection& reader);

/// Erasures while the program runs. Thread: any but the writer's. The arguments must outlive it.
class Erasures {
 public:
  Erasures(DbWriter& writer, ReaderPool& readers, SessionScoring& scoring, RetentionRuns& retention,
           const LongWork& long_work)
      : writer_(writer), readers_(readers), scoring_(scoring), retention_(retention), long_work_(long_work) {}

  /// Erases a person, up to the commit, and begins the remaining steps (goOn).
  Result<pb::Reply> begin(const handlers::Context& context, const pb::ErasePerson& call);
  /// One step after the person was erased: removes chunks (during a retention run, leaves them to the next
  /// run) and empties the log. The erasure is pending while readers need the log.
  Result<pb::Reply> goOn(RequestUnderWay& under_way);
  /// After an erasure: removes the chunks and has the log emptied. Returns a sentence about what remains. For
  /// start-up: makes no pauses, because no one is served yet.
  std::string finish();
  /// Adds people erased by other servers to DIR/erasures. Cheap if there is nothing new.
  Status completeList();

 private:
  /// Has the log emptied. Returns a sentence if readers still need it; empty: nothing erased is left.
  std::string emptyLog();

  DbWriter& writer_;
  ReaderPool& readers_;
  SessionScoring& scoring_;
  RetentionRuns& retention_;
  const LongWork& long_work_;
};

}  // namespace needlelab
