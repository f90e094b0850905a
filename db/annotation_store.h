/// Remarks of instructors on a tick of a session.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/base/uuid.h"
#include "db/connection.h"

namespace needlelab {

struct StoredAnnotation {
  std::uint64_t id = 0;
  Uuid session{};
  std::uint64_t tick = 0;
  std::string text;
  std::string author;
  std::int64_t created_unix_ns = 0;
};

/// Functions on a connection, which it does not own. Thread: as its Connection; changes need the writer's.
class AnnotationStore {
 public:
  explicit AnnotationStore(Connection& connection) : connection_(connection) {}

  /// Gives the new id; `annotation.id` is not read. Errors: kInvalidInput (text), kNotFound (session).
  Result<std::uint64_t> add(const StoredAnnotation& annotation);
  /// By tick. kNotFound: unknown session.
  Result<std::vector<StoredAnnotation>> list(const Uuid& session);

 private:
  Connection& connection_;
};

}  // namespace needlelab
