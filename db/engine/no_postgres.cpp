// For builds without libpq.
#include "db/engine/open_postgres.h"

namespace needlelab {

Result<std::unique_ptr<EngineConnection>> openPostgres(const PostgresOptions& /*options*/) {
  return Error{
      ErrorCode::kInvalidInput,
      "--store: these programs were built without PostgreSQL: install it with deploy/setup --faculty, "
      "then build again"};
}

}  // namespace needlelab
