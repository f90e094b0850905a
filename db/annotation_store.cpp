#include "db/annotation_store.h"

#include "common/base/text.h"
#include "db/session_row.h"

namespace needlelab {

Result<std::uint64_t> AnnotationStore::add(const StoredAnnotation& annotation) {
  if (auto valid = checkNote("annotation, text", annotation.text, 1, kMaxNoteBytes); !valid)
    return valid.error();
  const auto session = findSession(connection_, annotation.session);
  if (!session) return session.error();
  if (!*session) return unknownSession(annotation.session);
  if (auto done = connection_.run(
          "INSERT INTO annotations (session, tick, text, author, created_unix_ns) VALUES (?,?,?,?,?)",
          (*session)->number, annotation.tick, annotation.text, annotation.author,
          annotation.created_unix_ns);
      !done) {
    return done.error();
  }
  return static_cast<std::uint64_t>(connection_.lastRowId());
}

Result<std::vector<StoredAnnotation>> AnnotationStore::list(const Uuid& session) {
  const auto found = findSession(connection_, session);
  if (!found) return found.error();
  if (!*found) return unknownSession(session);
  std::vector<StoredAnnotation> annotations;
  auto rows = connection_.query(
      "SELECT id, tick, text, author, created_unix_ns FROM annotations WHERE session = ? ORDER BY tick, id",
      (*found)->number);
  for (;;) {
    const auto row = rows.step();
    if (!row) return row.error();
    if (!*row) return annotations;
    annotations.push_back(
        {rows.natural(0), session, rows.natural(1), rows.text(2), rows.text(3), rows.integer(4)});
  }
}

}  // namespace needlelab
