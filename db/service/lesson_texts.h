/// Profiles and curricula from text to what the stores keep. Private to this folder.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "base/result.h"
#include "db/curriculum_store.h"
#include "db/profile_store.h"

namespace needlelab {

/// Validated and canonical; `revision` is 0. `source` names the text in messages. kInvalidInput.
Result<StoredProfile> storedProfileOf(std::string_view json, std::string_view source,
                                      const std::string& author, std::int64_t now_unix_ns);
/// The same; requirements must name measures that exist.
Result<StoredCurriculum> storedCurriculumOf(std::string_view json, std::string_view source,
                                            const std::string& author, std::int64_t now_unix_ns);

/// Stores the samples that the binary holds (db/samples/*.json). In a transaction of the writer.
Status storeSamples(Connection& writer, std::int64_t now_unix_ns);

}  // namespace needlelab
