/// Requests of people and stations, executed on the store: the same code in the running server and in
/// `needlelab-admin --data DIR`.
#pragma once

#include <optional>
#include <string>

#include "base/result.h"
#include "db/db_writer.h"
#include "db/reader_pool.h"
#include "needlelab/control.pb.h"
#include "needlelab/session.pb.h"

namespace needlelab {

/// Who asks, after log-in.
struct Principal {
  std::string name;
  pb::Role role = pb::ROLE_UNSPECIFIED;
};

/// What became of a request.
struct Outcome {
  /// What only the running server can do; `needlelab-admin --data` says so to its user.
  enum class ServerPart {
    kNone,
    kFillStations,    ///< reply.stations is there: fill in `online` and `status`
    kDeliverMessage,  ///< request.trainee_message is allowed: send it to the station, then answer
    kNextExercise,    ///< request.next_exercise is allowed and its exercise exists: send it to the station,
                      ///< then answer
  };
  pb::Reply reply;                     ///< with the request's id
  std::optional<pb::Refusal> refusal;  ///< set: the request failed, `reply` holds only the id
  ServerPart server_part = ServerPart::kNone;
};

/// Thread: every function is thread-safe and blocks (reads: milliseconds; writes: until the commit;
/// passwords: about 0.1 s of argon2id and 64 MiB; backup and check: as long as the database is large). Call
/// them on worker threads, never on the network's. Owns nothing: writer and readers must outlive it.
class Service {
 public:
  Service(DbWriter& writer, ReaderPool& readers);

  /// Checks the role (roles.h), executes, writes the audit log.
  Outcome execute(const Principal& principal, const pb::Request& request);

  /// Password check. kDenied with one text for unknown, wrong and disabled, in about the same time.
  Result<Principal> loginPerson(const std::string& user, const std::string& password);
  /// Station key check. kDenied as above.
  Result<Principal> loginStation(const std::string& station, const std::string& key);
  /// False when a person was disabled, or a station revoked, since its log-in: for tokens.
  Result<bool> stillAllowed(const Principal& principal);

  /// Measures of a session's gesture (DESIGN §11) as JSON rows, from the stored chunks and the profile it ran
  /// with.
  Result<std::string> scoreSession(Connection& reader, const std::string& session_id);
  /// scoreSession(), then stores it. Returns the JSON.
  Result<std::string> scoreAndStore(const std::string& session_id);

 private:
  DbWriter& writer_;
  ReaderPool& readers_;
};

/// The refusal that an error of the store becomes on the wire.
pb::Refusal refusalOf(const Error& error);

}  // namespace needlelab
