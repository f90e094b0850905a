/// The table of requests: one row per call of pb::Request. requests.cpp shows each call's permitted roles.
#pragma once

#include <google/protobuf/descriptor.h>

#include <cstdint>
#include <span>
#include <string_view>

#include "common/base/result.h"
#include "db/service/context/context.h"
#include "db/service/context/principal.h"
#include "needlelab/control.pb.h"
#include "needlelab/types.pb.h"

namespace needlelab {

/// The thread pool that executes a request. With separate pools, a backup of minutes or a flood of passwords
/// does not delay a lesson.
enum class RequestThreads {
  kWorkers,    ///< short reads and writes
  kPasswords,  ///< argon2id: 0.1 s and 64 MiB each
  kViews,      ///< the engine, and lists over all sessions: tens of milliseconds to seconds
  kSlow,    ///< import of a class with passwords, a person's data over years, a backup: seconds to minutes; a
            ///< whole recording, in steps
  kScores,  ///< a score, in steps on the same thread; only few at once, because each holds up to 110 MB
  kHours,   ///< retention and rescoring: they yield to all other work
};

/// Whether a call stores something: a change, always with an audit line.
enum class Storing {
  kNothing,  ///< reads; many reads of one subject within an hour share one audit line
  kStores,   ///< counts towards the person's daily quota; refused while the disk is too full for recordings
  kNeeded,   ///< counts towards the quota, too, but is needed when the disk is full: to free space, withdraw
             ///< access, stop something, or save data. Refused only below the last limit, where an audit line
             ///< could fail
};

/// The part of a reply that only the running server can add; `needlelab-admin --data` tells its user so.
enum class ServerPart {
  kNone,
  kFillStations,  ///< the reply lists the stations: the server fills in `online` and `status`
  kDeliver,       ///< the message to a station is permitted and logged: the server sends it, then replies
};

/// A line of the HTTP interface: "GET /people/{name}/progress?exercise&page", relative to /api/v1, with the
/// query's parameter names. server/web copies address, query and body into the call's fields of the same
/// names (rules in routes.h); other routes have an adapter there. "/scores.*" stands for one address for each
/// format of the export (common/export), such as "/scores.csv".
struct HttpLine {
  std::string_view line;
  std::string_view summary;  ///< for the description of the API (OpenAPI)
};

/// The function that executes a call, with its message type and whether it stores.
struct RequestHandler {
  /// Executes one step; sets `under_way`.
  Result<pb::Reply> (*run)(const ServiceParts& parts, const Principal& who, const pb::Request& request,
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

/// The thread pool for this request from a peer with this role: its row's, except that a station's lesson
/// with a trainee's code, which must be hashed, goes to kPasswords, one at a time. So a lesson without a code
/// does not wait for a hash, and the limit on argon2's memory holds.
RequestThreads threadsOf(const pb::Request& request, pb::Role role);

/// The row's value; kNothing for unknown calls, which are refused.
Storing storingOf(pb::Request::CallCase call);

/// "user add", "session list", …; "?" for an unknown call.
std::string_view callName(pb::Request::CallCase call);
/// Whether the row permits `role`; false for numbers outside the enum.
bool mayAsk(const RequestRow& row, pb::Role role);
/// kDenied names the call, the role and the permitted roles; kInvalidInput: the request contains no known
/// call.
Status checkRole(const Principal& principal, pb::Request::CallCase call);

}  // namespace needlelab
