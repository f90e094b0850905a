/// The HTTP routes. The rows of db/service/requests/requests.cpp contain the addresses; this file converts an
/// HTTP request to its row's call and the reply to JSON.
///
/// A plain route needs only its row:
/// - `{id}` of the address fills the call's field `id`, or `session_id` below /sessions, `exercise_id` below
///   /exercises and so on; `{name}` fills `name`, or `trainee`;
/// - `?course` of the query fills `course` or `course_id`; numbers must be whole and at least 1; booleans are
///   yes or no;
/// - the body (JSON) fills the other fields; `base_revision` comes from If-Match;
/// - the reply's result is written unchanged; a list becomes {"items": […], "next_page": …}.
/// Any other route has an adapter (route_adapters.cpp).
#pragma once

#include <google/protobuf/message.h>

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/export/export_formats.h"
#include "db/service/requests/requests.h"
#include "db/service/service.h"
#include "needlelab/control.pb.h"
#include "server/base/http_message.h"
#include "server/web/web_call.h"

namespace needlelab {

inline constexpr std::string_view kApiBase = "/api/v1";

struct WebRoute;

Result<pb::Request> plainRequest(const WebRoute& route, const WebCall& call);
WebJson plainReply(const WebCall& call, const pb::Reply& reply);

/// The kinds of routes.
enum class WebAction {
  kRequest,  ///< `build` → the service → `shape`
  kWork,     ///< `work` on a worker's thread: several requests that read
  kSteps,    ///< `steps`: likewise, for slow work
  kLogIn,
  kWhoAmI,
  kLogOut,
  kLive,     ///< becomes a WebSocket
  kOpenApi,  ///< the API's description (openApiText), the same for every logged-in user
  kStream,   ///< `stream`
};

/// The differences of a route from a plain one. `build` runs on the network's thread, or on a worker's when
/// the body is large; the others run on a worker's.
struct RouteAdapter {
  std::string_view line = {};  ///< "POST /people", without the query
  WebAction action = WebAction::kRequest;
  Result<pb::Request> (*build)(const WebRoute& route, const WebCall& call) = plainRequest;
  WebJson (*shape)(const WebCall& call, const pb::Reply& reply) = plainReply;
  Result<WebJson> (*work)(Service& service, const WebCall& call) = nullptr;
  Result<WebSteps> (*steps)(Service& service, const WebCall& call) = nullptr;
  Result<WebStream> (*stream)(Service& service, const WebRoute& route, const WebCall& call) = nullptr;
  unsigned status = 200;
  std::optional<ExportPlace> place = {};  ///< of a line that ends in ".*": one route for each of its formats
};
std::span<const RouteAdapter> routeAdapters();

struct WebRoute {
  std::string_view method;
  std::string_view pattern;                  ///< below kApiBase, e.g. "/people/{name}"
  std::vector<std::string_view> query = {};  ///< the accepted parameters
  std::string_view summary = {};
  /// The call's row in db/service/requests/requests.cpp gives the permitted roles; CALL_NOT_SET: every
  /// logged-in user (for some routes also before log-in).
  pb::Request::CallCase call = pb::Request::CALL_NOT_SET;
  RouteAdapter how = {};
  const ExportFormat* format = nullptr;  ///< of a download at RouteAdapter::place
};

/// All routes; at the same position, fixed parts come before {…}.
std::span<const WebRoute> webRoutes();

struct WebMatch {
  const WebRoute* route = nullptr;
  std::vector<std::string> parts;    ///< the values of {…}
  std::vector<std::string> allowed;  ///< the path's methods, when the path is known but the method is not
};
/// `segments` without "api" and "v1".
WebMatch matchRoute(std::string_view method, std::span<const std::string> segments);

/// The source of each message field of a route.
struct PlainFields {
  using Field = const google::protobuf::FieldDescriptor*;
  std::vector<Field> parts,
      query;  ///< in the order of {…} and of WebRoute::query; null when the call has no such field
  std::vector<Field> body;  ///< all other fields; empty for GET
  Field base = nullptr;     ///< base_revision, from If-Match
};
PlainFields plainFieldsOf(const WebRoute& route);
/// Whether a request of this route has fields in its body.
bool acceptsBody(const WebRoute& route);
/// The message's list of rows; null when the message is not a list.
const google::protobuf::FieldDescriptor* rowsOf(const google::protobuf::Descriptor& message);

// --- for the adapters

/// A list's reply: `rows` are its items.
WebJson listOf(const google::protobuf::Message& list, const std::string& rows);
/// Copies `?page=` into a request. kInvalidInput.
Status setPage(const WebCall& call, std::string& page);
/// Reads the body into a request; its `outside` fields come from the address or the header.
Status readBodyInto(const WebCall& call, google::protobuf::Message& message,
                    const std::vector<std::string>& outside);
/// The service's reply, or its error. On a worker's thread.
Result<pb::Reply> replyOf(Service& service, const WebCall& call, const pb::Request& request);
/// A stream with its first piece already made, so that an invalid request is refused before the file begins.
/// In `file_name`, any character but letters, digits, '-', '_' and '.' becomes '_'. On a worker's thread.
Result<WebStream> streamFromFirst(std::string type, std::string file_name,
                                  std::function<Result<WebPiece>()> next);
/// The same with the format's type and suffix.
Result<WebStream> streamFromFirst(const ExportFormat& format, const std::string& name,
                                  std::function<Result<WebPiece>()> next);
/// The address's {id} as a session's id.
template <typename Message>
Status setSession(const WebCall& call, Message& message) {
  ASSIGN_OR_RETURN(auto id, sessionBytesOf(call.parts[0]));
  message.set_session_id(std::move(id));
  return {};
}
/// The required If-Match: a change must name its base revision.
Result<std::uint32_t> baseOf(const WebCall& call);

// --- files made piece by piece (route_streams.cpp). On a worker's thread

/// All of a person's records as one document.
Result<WebStream> personRecords(Service& service, const WebRoute& route, const WebCall& call);
/// A course's results in the route's format; `?separator=`.
Result<WebStream> resultStream(Service& service, const WebRoute& route, const WebCall& call);
/// Scores in the route's format, one measure per line.
Result<WebStream> scoreStream(Service& service, const WebRoute& route, const WebCall& call);

// --- the API's OpenAPI description, generated from the routes and the messages

/// OpenAPI 3.1 as JSON. Generated on the first call; valid until the program ends.
std::string_view openApiText();

}  // namespace needlelab
