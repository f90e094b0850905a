// Where libpq is not installed.
#include "tests/bench/ingest/ingest_stores.h"

namespace needlelab::test {

std::unique_ptr<IngestContender> ingestRawPostgres(const IngestSettings&, const std::string&, std::size_t,
                                                   RawPostgresForm) {
  dieOfIngest("was built without libpq");
}

}  // namespace needlelab::test
