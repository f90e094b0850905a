/// The few facts of a session that every operation on it needs. Private to session_store.cpp and its
/// neighbours.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "common/base/uuid.h"
#include "common/gesture/session_hash.h"
#include "db/chunk_scan.h"
#include "db/connection.h"
#include "needlelab/types.pb.h"

namespace needlelab {

struct SessionRow {
  std::int64_t number = 0;
  std::string station;
  pb::SessionState state = pb::SESSION_OPEN;
  // of the original recording, whatever retention has made of it; while it is open they stand in
  // session_progress, afterwards in its row
  std::uint64_t chunks = 0;
  std::uint64_t samples = 0;
  std::uint64_t stored_bytes = 0;
  bool counting = false;       ///< has a row in session_progress, as every open session has and no other
  std::optional<Digest> hash;  ///< once it is closed
  StoredRecording::Kind recording = StoredRecording::Kind::kOriginal;
  bool erased = false;  ///< its person's data was erased
};

/// Nothing when the session is unknown; an error when the database fails.
Result<std::optional<SessionRow>> findSession(Connection& connection, const Uuid& session);

/// kNotFound, with the session's name.
Error unknownSession(const Uuid& session);

/// The recording that can be read now. kCorrupt: the row of a thinned one is not there.
Result<StoredRecording> recordingOf(Connection& connection, const std::string& name, const SessionRow& row);

/// "its recording was thinned to 100 Hz on 2026-11-20 …": why the original is not there. For messages.
Result<std::string> removalText(Connection& connection, const SessionRow& row);

/// kNotFound: when and why it was deleted, what is kept.
Error recordingDeleted(Connection& connection, const std::string& name, const SessionRow& row);

/// recordingOf() of a session by its id. kNotFound: the session is unknown, or its recording was deleted
/// (when and why). Within one view (Transaction::view) it is the recording of the chunks that are read next.
Result<StoredRecording> readableRecording(Connection& connection, const Uuid& session);

/// A hash from a column; nothing unless it has 32 bytes.
std::optional<Digest> digestOf(ByteView bytes);

/// 16 bytes as a Uuid; nothing when there are more or fewer.
std::optional<Uuid> uuidOf(std::string_view bytes);
/// For messages: the id's text, or that it is none.
std::string sessionText(std::string_view bytes);

/// The CRC that the station put at the chunk's end (common/gesture/FORMAT.md): its last four bytes; 0 when it
/// is shorter. A CRC over all of its bytes would be the same number for every chunk, because they end with
/// their own.
std::int64_t stationCrcOf(ByteView chunk);

/// A row of `chunks` as read back: its bytes must agree with the CRC at their end, this with the one kept in
/// the row, and the sample counts with each other. kCorrupt names session and chunk. Gives the sample count.
Result<std::uint64_t> checkStoredChunk(const std::string& name, std::uint64_t seq, std::uint64_t samples,
                                       std::int64_t crc, ByteView bytes);

}  // namespace needlelab
