/// Policies of retention, and the steps by which a recording is thinned or deleted
/// (migrations/0003_retention.sql). Who takes the steps, and in which pieces: service/retention.h.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "common/base/uuid.h"
#include "common/gesture/session_hash.h"
#include "db/connection.h"
#include "needlelab/control.pb.h"

namespace needlelab {

/// A closed session whose policy's time has come.
struct DueRecording {
  Uuid session{};
  std::string exercise_id;
  bool thinned = false;            ///< it is already; only deleting is left
  bool deletes = false;            ///< else: thin
  bool waits_for_backup = false;   ///< due, but not covered by a verified backup: not to be touched
  std::uint64_t stored_bytes = 0;  ///< of the recording that is there
  pb::RetentionPolicy policy;
  std::string reason;  ///< "thinned to 100 Hz, 30 days after it was closed (policy of knee-1 by mia)"
};

/// A thinned recording that has been written.
struct DerivedSums {
  std::uint64_t chunks = 0, samples = 0, stored_bytes = 0;
  Digest hash{};
};

/// Thread: as its connection. What changes something needs the writer's, inside DbWriter; each such call is
/// one step that may be the last before a crash. due(), policies(), leftovers(), sums() only read.
class RetentionStore {
 public:
  explicit RetentionStore(Connection& connection) : connection_(connection) {}

  /// kInvalidInput names field, value and range.
  Status setPolicy(const pb::RetentionPolicy& policy);
  /// A name for a policy: empty (the default), an exercise of a curriculum, one with stored sessions (its
  /// curriculum may be gone), or one that has a policy already. Else kInvalidInput, naming the exercises
  /// there are: a misspelt policy would never act, and the recordings be treated by the default. A policy
  /// comes after its exercise.
  Status checkExercise(const std::string& exercise_id);
  /// The exercise follows the default again. kNotFound: it had no policy of its own.
  Status removePolicy(const std::string& exercise_id);
  /// The default first, then by exercise.
  Result<std::vector<pb::RetentionPolicy>> policies();

  /// Closed sessions whose time has come at `now`, oldest first within an exercise; also those that wait for
  /// a backup. Open sessions never.
  Result<std::vector<DueRecording>> due(std::int64_t now_unix_ns);

  /// Begins a thinned recording beside the original. kUnavailable: the session is not closed, or its original
  /// is gone, or another one is begun.
  Status beginDerived(const Uuid& session, double rate_hz, std::int64_t now_unix_ns);
  /// The next chunk of it; checked (CRC) like one from a station.
  Status appendDerived(const Uuid& session, std::uint64_t seq, ByteView bytes);
  /// What the thinned recording holds, read back from the database. kCorrupt names the chunk that fails.
  Result<DerivedSums> sums(const Uuid& session);
  /// From here on the thinned recording is the session's, and the original on its way out. `crcs`: of the
  /// original's chunks, in order. kUnavailable when the session is not as `due` and beginDerived() left it,
  /// or its exercise's policy is not the one of `due` any more.
  Status switchToDerived(const DueRecording& due, const DerivedSums& sums, const Bytes& crcs,
                         const std::string& by_whom, std::int64_t now_unix_ns);
  /// From here on the session has no recording. `crcs` as above; not used when the original went before.
  Status markDeleted(const DueRecording& due, const Bytes& crcs, const std::string& by_whom,
                     std::int64_t now_unix_ns);

  /// Sessions of which rows are still to be removed: recordings that were replaced or deleted, and thinned
  /// ones that a crash left unfinished.
  Result<std::vector<Uuid>> leftovers();
  /// Reads the rows that removeSome() would remove, each with its overflow pages: deleting a row whose pages
  /// are damaged would stop the writer, or free the page of another row. kCorrupt names the first that fails.
  /// For a reader.
  Status checkLeftovers(const Uuid& session);
  /// Removes at most `rows` of them, the last ones first. False: all are gone, and so is the note of it.
  Result<bool> removeSome(const Uuid& session, std::uint32_t rows);

  struct Space {
    std::uint64_t database_bytes = 0;  ///< the file, without its log
    std::uint64_t free_bytes = 0;      ///< of it: free pages, which are used before the file grows
  };
  Result<Space> space();

 private:
  Connection& connection_;
};

}  // namespace needlelab
