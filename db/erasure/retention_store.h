/// Retention policies, and the steps that thin or delete a recording (migrations/0001_first.sql).
/// service/retention.h runs the steps.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/bytes.h"
#include "common/base/result.h"
#include "common/base/text/uuid.h"
#include "common/gesture/chunk.h"
#include "db/audit/audit.h"
#include "db/store/connection.h"
#include "needlelab/control.pb.h"

namespace needlelab {

/// Precedes the name of the policy's author at the end of a removal reason.
inline constexpr std::string_view kSetBy = ", set by ";

/// A closed session that is due by its policy.
struct DueRecording {
  Uuid session{};
  std::string exercise_id;
  bool thinned = false;           ///< already thinned; only deletion is left
  bool deletes = false;           ///< else: to be thinned
  bool waits_for_backup = false;  ///< due, but no verified backup covers it: must not be touched
  bool clock_was_behind =
      false;  ///< due only by the time of a clock that was behind when it was closed: must not be touched
  std::uint64_t stored_bytes = 0;  ///< of the stored recording
  pb::RetentionPolicy policy;
  /// "thinned to 100 Hz, 30 days after it was closed (policy of knee-1 by mia)", or what is known about the
  /// clock
  std::string reason;
};

/// A complete thinned recording.
struct DerivedSums {
  std::uint64_t chunks = 0, samples = 0, stored_bytes = 0;
  Digest hash{};
};

/// Thread: as its connection. Changing functions need the writer's connection, inside DbWriter. Each call is
/// one step, and a crash may follow any step. due(), policies(), leftovers(), sums() only read.
class RetentionStore {
 public:
  explicit RetentionStore(Connection& connection) : connection_(connection) {}

  /// kInvalidInput names field, value and range.
  static Status checkPolicy(const pb::RetentionPolicy& policy);
  /// Errors: as checkPolicy().
  Status setPolicy(const pb::RetentionPolicy& policy);
  /// Checks an exercise name in `field`: empty (the default, or all), an exercise of a curriculum, one with
  /// stored sessions (its curriculum may be gone), or one that already has a policy. Otherwise kInvalidInput
  /// lists the existing exercises: a policy for a misspelt name would never apply, and the default would
  /// govern the recordings. Create the exercise before its policy.
  Status checkExercise(const std::string& exercise_id, const std::string& field);
  /// Makes the default policy apply to the exercise again. kNotFound: it has no policy of its own.
  Status removePolicy(const std::string& exercise_id);
  /// The default first, then by exercise.
  Result<std::vector<pb::RetentionPolicy>> policies();

  /// Closed sessions that are due at `now`, oldest first within an exercise: those to delete, to thin, and to
  /// leave alone, including those waiting for a backup. A recording's age counts from the newest of these
  /// times that is not after `now`: its close, the arrival of its first chunk, its start by the station's
  /// clock, the creation of the database, and the latest time that the server's clock had shown before the
  /// close (seen_time.h). Never open sessions.
  Result<std::vector<DueRecording>> due(std::int64_t now_unix_ns);

  /// Begins a thinned recording beside the original. kUnavailable: the session is not closed, its original is
  /// gone, or another thinning has begun.
  Status beginDerived(const Uuid& session, double rate_hz, std::int64_t now_unix_ns);
  /// Appends the next chunk of the thinned recording; checks its CRC as for a station's chunk.
  Status appendDerived(const Uuid& session, std::uint64_t seq, ByteView bytes);
  /// Reads the thinned recording back from the database and sums it up. kCorrupt names the damaged chunk.
  Result<DerivedSums> sums(const Uuid& session);
  /// Makes the thinned recording the session's recording; the original will be removed. `crcs`: of the
  /// original's chunks, in order. `now_unix_ns`: when the run by `by_whom` began. kUnavailable: the session
  /// has changed since `due` and beginDerived(), or its exercise's policy differs from that in `due`.
  Status switchToDerived(const DueRecording& due, const DerivedSums& sums, const Bytes& crcs,
                         const Doer& by_whom, std::int64_t now_unix_ns);
  /// Marks the session as having no recording. `crcs`: as above; unused if the original is already gone.
  Status markDeleted(const DueRecording& due, const Bytes& crcs, const Doer& by_whom,
                     std::int64_t now_unix_ns);

  /// Sessions with rows still to remove: of replaced or deleted recordings, and of thinnings interrupted by a
  /// crash.
  Result<std::vector<Uuid>> leftovers();
  struct RemovableRows {
    std::uint32_t rows = 0;  ///< how many removeSome() may remove
    bool more = false;       ///< the session has further rows to remove
  };
  /// Reads the rows that removeSome() would remove next, including their overflow pages: deleting a row on
  /// damaged pages would stop the writer or free another row's page. kCorrupt names the first damaged row.
  /// Runs on a reader.
  Result<RemovableRows> checkSome(const Uuid& session, std::uint32_t rows);
  /// Removes at most `rows` rows, last ones first. False: all rows are gone, as is the note of them.
  Result<bool> removeSome(const Uuid& session, std::uint32_t rows);

  struct Space {
    std::uint64_t database_bytes = 0;  ///< the file, without its log
    std::uint64_t free_bytes = 0;      ///< of those, in free pages, which are reused before the file grows
  };
  Result<Space> space();

 private:
  Connection& connection_;
};

}  // namespace needlelab
