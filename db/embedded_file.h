/// Text files that were put into the binary at build time (deploy/cmake/NeedlelabEmbed.cmake).
#pragma once

#include <span>

#include "common/base/program.h"

namespace needlelab {

/// db/migrations/*.sql, in order of their numbers.
std::span<const EmbeddedFile> embeddedMigrations();
/// db/samples/*.json: profiles and curricula for a new database. In needlelab::service.
std::span<const EmbeddedFile> embeddedSamples();

}  // namespace needlelab
