/// The table of requests: one row for each call of pb::Request. Whoever wants to know who may ask for what
/// reads requests.cpp from top to bottom.
#pragma once

#include <google/protobuf/descriptor.h>

#include <span>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "needlelab/control.pb.h"
#include "needlelab/types.pb.h"

namespace needlelab {

class Service;

/// A person or a station, after log-in.
struct Principal {
  std::string name;
  pb::Role role = pb::ROLE_UNSPECIFIED;
};

/// The threads that execute a request. A backup of minutes or a flood of passwords does not hold up a lesson.
enum class RequestThreads {
  kWorkers,    ///< short reads and writes
  kPasswords,  ///< argon2id: 0.1 s and 64 MiB each
  kViews,      ///< the engine, and lists over all sessions: tens of milliseconds to seconds
  kSlow,       ///< a class with passwords, a person's years, a whole recording, a backup: seconds to minutes
  kHours,      ///< retention and rescoring: everybody else goes first
};

/// What only the running server can add to a reply; `needlelab-admin --data` says so to its user.
enum class ServerPart {
  kNone,
  kFillStations,  ///< the reply holds the stations: the server fills in `online` and `status`
  kDeliver,       ///< the message to a station is allowed and noted: the server sends it, then answers
};

/// A line of the HTTP interface: "GET /people/{name}/progress?exercise&page", below /api/v1, with the names
/// of the query. server/web reads the address, the query and the body into the call's fields of the same
/// names (routes.h has the rules); routes that need more have an adapter there.
struct HttpLine {
  std::string_view line;
  std::string_view summary;  ///< for the description of the API (OpenAPI)
};

/// What executes a call.
struct RequestHandler {
  Result<pb::Reply> (*run)(Service& service, const Principal& who, const pb::Request& request) = nullptr;
  const google::protobuf::Descriptor* (*message)() = nullptr;  ///< the type of the call's message
};

struct RequestRow {
  pb::Request::CallCase call = pb::Request::CALL_NOT_SET;
  std::string_view action;  ///< in the audit log, in refusals and on the command line
  unsigned roles = 0;       ///< a bit for each role that may ask
  RequestHandler handler = {};
  pb::Reply::ResultCase reply = pb::Reply::RESULT_NOT_SET;
  RequestThreads threads = RequestThreads::kWorkers;
  /// An empty line: none.
  HttpLine http[2] = {};
  ServerPart server_part = ServerPart::kNone;
};

std::span<const RequestRow> requestRows();
/// Null for CALL_NOT_SET and for calls that this program does not know.
const RequestRow* requestRow(pb::Request::CallCase call);

/// "user add", "session list", …; "?" for no known call.
std::string_view callName(pb::Request::CallCase call);
/// True when the row's roles hold `role`; false for numbers that are not a role.
bool mayAsk(const RequestRow& row, pb::Role role);
/// kDenied names the call, the role, and the roles that may; kInvalidInput: the request holds no known call.
Status checkRole(const Principal& principal, pb::Request::CallCase call);

/// "curriculum-manager" and the like.
std::string_view roleName(pb::Role role);
/// The inverse; ROLE_UNSPECIFIED for any other text.
pb::Role roleOfName(std::string_view name);

}  // namespace needlelab
