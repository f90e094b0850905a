// For builds without libpq.
#include "db/engine/open_postgres.h"

namespace needlelab {

namespace {

Error notBuilt() {
  return {ErrorCode::kInvalidInput,
          "--store: these programs were built without PostgreSQL: install libpq-dev (15 or newer), "
          "then build again"};
}

}  // namespace

Status checkAddressFromOutside(const std::string& /*url*/) {
  return notBuilt();
}

Result<std::unique_ptr<EngineConnection>> openPostgres(const PostgresOptions& /*options*/) {
  return notBuilt();
}

}  // namespace needlelab
