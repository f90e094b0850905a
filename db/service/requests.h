/// The table of requests: one row per call of pb::Request. requests.cpp shows each call's permitted roles.
#pragma once

#include <google/protobuf/descriptor.h>

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "db/audit.h"
#include "needlelab/control.pb.h"
#include "needlelab/types.pb.h"

namespace needlelab {

class Service;
struct RequestUnderWay;

/// The asker of a request: a person or a station.
struct Principal {
  std::string name;  ///< a person's ref; a station's name
  pb::Role role = pb::ROLE_UNSPECIFIED;
  /// Came by a log-in. The account may be disabled, or change its role, while its requests wait for their
  /// turn: each is refused unless the account still holds then, and once more where a change is written.
  bool logged_in = false;
  /// Of servers that work together: the number of the account's last change of access (access_numbers.h) when
  /// it logged in. With another number now its access does not hold. Nothing: not compared.
  std::optional<std::int64_t> access_number{};
  std::string called{};  ///< a person's name when it logged in
  [[nodiscard]] const std::string& shown() const { return called.empty() ? name : called; }
  [[nodiscard]] Doer doer() const { return {name, called}; }
};

/// The thread pool that executes a request. Separate pools keep a backup of minutes or a flood of passwords
/// from delaying a lesson.
enum class RequestThreads {
  kWorkers,    ///< short reads and writes
  kPasswords,  ///< argon2id: 0.1 s and 64 MiB each
  kViews,      ///< the engine, and lists over all sessions: tens of milliseconds to seconds
  kSlow,    ///< import of a class with passwords, a person's data over years, a backup: seconds to minutes;
            ///< a whole recording, in steps
  kScores,  ///< a score, in steps on the same thread; few are under way at once, for it holds up to 110 MB
  kHours,   ///< retention and rescoring: they yield to all other work
};

/// Whether a call has something stored: a change, and always a line of the audit log.
enum class Storing {
  kNothing,  ///< reads; many reads of one subject within an hour make one line
  kStores,   ///< takes a share of the person's day; refused while the disk is too full for recordings
  kNeeded,   ///< takes a share, too, but is needed just then: to free room, to shut somebody out, to stop, to
             ///< take data to safety. Refused only at the last floor, where a line could fail
};

/// The part of a reply that only the running server can add; `needlelab-admin --data` tells its user so.
enum class ServerPart {
  kNone,
  kFillStations,  ///< the reply lists the stations: the server fills in `online` and `status`
  kDeliver,       ///< the message to a station is permitted and logged: the server sends it, then answers
};

/// A line of the HTTP interface: "GET /people/{name}/progress?exercise&page", relative to /api/v1, with the
/// names of the query. server/web copies address, query and body into the call's fields of the same names
/// (rules in routes.h); other routes have an adapter there.
struct HttpLine {
  std::string_view line;
  std::string_view summary;  ///< for the description of the API (OpenAPI)
};

/// The function that executes a call, with its message type and whether it stores.
struct RequestHandler {
  /// Does one step; sets `under_way`.
  Result<pb::Reply> (*run)(Service& service, const Principal& who, const pb::Request& request,
                           RequestUnderWay& under_way) = nullptr;
  const google::protobuf::Descriptor* (*message)() = nullptr;  ///< the type of the call's message
  Storing storing = Storing::kNothing;
};

struct RequestRow {
  pb::Request::CallCase call = pb::Request::CALL_NOT_SET;
  std::string_view action;  ///< the name in the audit log, in refusals and on the command line
  unsigned roles = 0;       ///< a bit for each permitted role
  RequestHandler handler = {};
  pb::Reply::ResultCase reply = pb::Reply::RESULT_NOT_SET;
  RequestThreads threads = RequestThreads::kWorkers;
  /// An empty line: unused.
  HttpLine http[2] = {};
  ServerPart server_part = ServerPart::kNone;
};

std::span<const RequestRow> requestRows();
/// Null for CALL_NOT_SET and for calls unknown to this program.
const RequestRow* requestRow(pb::Request::CallCase call);

/// The thread pool of this request of a peer with this role: its row's; or kPasswords, one at a time, for a
/// station's lesson with a trainee's code, which is hashed. So a lesson without a code waits behind no hash,
/// and the bound on argon2's memory holds.
RequestThreads threadsOf(const pb::Request& request, pb::Role role);

/// The row's; kNothing for unknown calls, which are refused.
Storing storingOf(pb::Request::CallCase call);

/// "user add", "session list", …; "?" for an unknown call.
std::string_view callName(pb::Request::CallCase call);
/// True when the row permits `role`; false for numbers outside the enum.
bool mayAsk(const RequestRow& row, pb::Role role);
/// kDenied names the call, the role, and the permitted roles; kInvalidInput: the request holds no known call.
Status checkRole(const Principal& principal, pb::Request::CallCase call);

/// "curriculum-manager" etc.
std::string_view roleName(pb::Role role);
/// The inverse; ROLE_UNSPECIFIED for any other text.
pb::Role roleOfName(std::string_view name);

}  // namespace needlelab
