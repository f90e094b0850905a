/// What the tables of routes have in common. Private to this folder.
#pragma once

#include <functional>
#include <span>
#include <string>

#include "server/web/reply_json.h"
#include "server/web/routes.h"
#include "server/web/web_call.h"

namespace needlelab {

std::span<const WebRoute> peopleRoutes();   ///< people, groups, stations, the database itself
std::span<const WebRoute> lessonRoutes();   ///< profiles, courses, exercises, assignments, results
std::span<const WebRoute> sessionRoutes();  ///< sessions, samples, scores, references, studies

/// A reply that is a list: `rows` are its items.
WebJson listOf(const google::protobuf::Message& list, const std::string& rows);
/// `?page=` into a request. kInvalidInput.
Status setPage(const WebCall& call, std::string& page);
/// The body into a request whose `outside` fields (null ends them) stand in the address or the header.
Status readBodyInto(const WebCall& call, google::protobuf::Message& message,
                    std::initializer_list<const char*> outside);
/// The service's reply, or its error. On a worker's thread.
Result<pb::Reply> replyOf(Service& service, const WebCall& call, const pb::Request& request);
/// A stream whose first piece is made at once, so that what is wrong with the question is said before the
/// file begins. `file_name`: what is no letter, digit, '-', '_' or '.' becomes '_'. On a worker's thread.
Result<WebStream> streamFromFirst(std::string type, std::string file_name,
                                  std::function<Result<std::string>()> next);
/// {}.
WebJson emptyReply(const WebCall& call, const pb::Reply& reply);
/// {id} of the address as a session's.
template <typename Message>
Status setSession(const WebCall& call, Message& message) {
  auto id = sessionBytesOf(call.parts[0]);
  if (!id) return id.error();
  message.set_session_id(std::move(*id));
  return {};
}
/// If-Match, which must be there: who changes something says what it was.
Result<std::uint32_t> baseOf(const WebCall& call);

}  // namespace needlelab
