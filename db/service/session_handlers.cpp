#include "db/annotation_store.h"
#include "db/session_store.h"
#include "service/handlers.h"

namespace needlelab::handlers {
namespace {

void fill(pb::Annotation& annotation, const StoredAnnotation& stored) {
  annotation.set_id(stored.id);
  annotation.set_session_id(stored.session.data(), stored.session.size());
  annotation.set_tick(stored.tick);
  annotation.set_text(stored.text);
  annotation.set_author(stored.author);
  annotation.set_created_unix_ns(stored.created_unix_ns);
}

}  // namespace

Result<Uuid> sessionId(const std::string& bytes) {
  Uuid id;
  if (bytes.size() != id.size()) {
    return Error{ErrorCode::kInvalidInput,
                 "session_id: has " + std::to_string(bytes.size()) + " bytes, allowed are 16"};
  }
  std::copy(bytes.begin(), bytes.end(), id.begin());
  return id;
}

Result<pb::SessionInfo> visibleSession(const Context& context, const std::string& bytes) {
  const auto id = sessionId(bytes);
  if (!id) return id.error();
  auto info = SessionStore(context.reader).info(*id);
  if (info && context.who.role == pb::TRAINEE && info->description().trainee() != context.who.name) {
    return Error{ErrorCode::kNotFound, "there is no session " + uuidText(*id)};
  }
  return info;
}

Result<pb::Reply> listSessions(const Context& context, const pb::ListSessions& call) {
  const bool own = context.who.role == pb::TRAINEE;
  if (own && !call.trainee().empty() && call.trainee() != context.who.name) {
    return Error{ErrorCode::kDenied, "a trainee sees own sessions only"};
  }
  auto sessions = SessionStore(context.reader)
                      .list(call.station(), own ? context.who.name : call.trainee(), call.limit());
  if (!sessions) return sessions.error();
  pb::Reply reply;
  auto* list = reply.mutable_sessions();
  std::size_t bytes = 0;
  for (pb::SessionInfo& session : *sessions) {
    bytes += session.ByteSizeLong() + 8;
    if (bytes > kMaxReplyBytes) break;
    *list->add_sessions() = std::move(session);
  }
  return reply;
}

Result<pb::Reply> getSession(const Context& context, const pb::GetSession& call) {
  auto info = visibleSession(context, call.session_id());
  if (!info) return info.error();
  pb::Reply reply;
  *reply.mutable_session() = std::move(*info);
  return reply;
}

Result<pb::Reply> readChunks(const Context& context, const pb::ReadChunks& call) {
  const auto info = visibleSession(context, call.session_id());
  if (!info) return info.error();
  constexpr std::uint32_t kMostChunks = 4096;
  const std::uint32_t most = call.max_chunks() == 0 ? kMostChunks : std::min(call.max_chunks(), kMostChunks);
  // an envelope of 40 bytes comes with each chunk
  constexpr std::size_t kMostBytes = kMaxReplyBytes - kMostChunks * 40;
  const auto id = sessionId(call.session_id());
  auto chunks = SessionStore(context.reader).readChunks(*id, call.from_seq(), most, kMostBytes);
  if (!chunks) return chunks.error();
  pb::Reply reply;
  auto* list = reply.mutable_chunks();
  for (const StoredChunk& chunk : *chunks) {
    auto* entry = list->add_chunks();
    entry->set_session_id(call.session_id());
    entry->set_seq(chunk.seq);
    entry->set_data(chunk.bytes.data(), chunk.bytes.size());
  }
  list->set_end(call.from_seq() >= info->chunks() || call.from_seq() + chunks->size() >= info->chunks());
  return reply;
}

Result<pb::Reply> verifySession(const Context& context, const pb::VerifySession& call) {
  const auto id = sessionId(call.session_id());
  if (!id) return id.error();
  const auto check = SessionStore(context.reader).verify(*id);
  if (!check) return check.error();
  pb::Reply reply;
  auto* verified = reply.mutable_verified();
  verified->set_ok(check->ok);
  verified->set_chunks(check->chunks);
  verified->set_samples(check->samples);
  verified->set_hash(check->hash.data(), check->hash.size());
  verified->set_text(check->text);
  return reply;
}

Result<pb::Reply> annotate(const Context& context, const pb::Annotate& call) {
  const auto id = sessionId(call.session_id());
  if (!id) return id.error();
  StoredAnnotation annotation{0, *id, call.tick(), call.text(), context.who.name, context.now_unix_ns};
  const auto status =
      write(context, uuidText(*id), "tick " + std::to_string(call.tick()), [&](Connection& writer) {
        const auto added = AnnotationStore(writer).add(annotation);
        if (!added) return Status(added.error());
        annotation.id = *added;
        return Status();
      });
  if (!status) return status.error();
  pb::Reply reply;
  fill(*reply.mutable_annotation(), annotation);
  return reply;
}

Result<pb::Reply> listAnnotations(const Context& context, const pb::ListAnnotations& call) {
  if (const auto visible = visibleSession(context, call.session_id()); !visible) return visible.error();
  const auto id = sessionId(call.session_id());
  const auto annotations = AnnotationStore(context.reader).list(*id);
  if (!annotations) return annotations.error();
  pb::Reply reply;
  auto* list = reply.mutable_annotations();
  std::size_t bytes = 0;
  for (const StoredAnnotation& stored : *annotations) {
    bytes += stored.text.size() + 256;
    if (bytes > kMaxReplyBytes) break;
    fill(*list->add_annotations(), stored);
  }
  return reply;
}

}  // namespace needlelab::handlers
