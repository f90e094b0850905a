/// Text files that were put into the binary at build time (embed.cmake).
#pragma once

#include <span>
#include <string_view>

namespace needlelab {

struct EmbeddedFile {
  std::string_view name;  ///< without folder
  std::string_view text;
};

/// db/migrations/*.sql, in order of their numbers.
std::span<const EmbeddedFile> embeddedMigrations();
/// db/samples/*.json: profiles and curricula for a new database. In needlelab::service.
std::span<const EmbeddedFile> embeddedSamples();

}  // namespace needlelab
