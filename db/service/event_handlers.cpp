// What was done with the syringe in a session.
#include "db/service/handlers.h"
#include "db/service/page.h"
#include "db/service/session_samples.h"
#include "db/session_results.h"
#include "db/session_store.h"

namespace needlelab::handlers {

Result<pb::Reply> listEvents(const Context& context, const pb::ListEvents& call) {
  const auto info = visibleSession(context, call.session_id());
  if (!info) return info.error();
  const auto id = sessionId(call.session_id());
  if (info->state() == pb::SESSION_OPEN)
    return Error{ErrorCode::kUnavailable,
                 "session " + uuidText(*id) + " is still open: its events are worked out when it is closed"};
  const auto from = numberOfPage(call.page());
  if (!from) return from.error();
  auto stored = EventStore(context.reader).list(*id);
  if (!stored) return stored.error();
  pb::Reply reply;
  auto* list = reply.mutable_events();
  list->set_stored(stored->has_value());
  // a session that was closed before events were stored, or could not be scored then
  if (!*stored) {
    const auto read = samplesOf(context.reader, *id);
    if (!read) return read.error();
    *stored = eventsOf(*read);
  }
  PageRoom room;
  for (std::uint64_t i = *from; i < (*stored)->size(); ++i) {
    pb::SyringeEvent& event = (**stored)[i];
    if (!room.take(event.ByteSizeLong())) {
      list->set_next_page(std::to_string(i));
      break;
    }
    *list->add_events() = std::move(event);
  }
  return reply;
}

}  // namespace needlelab::handlers
