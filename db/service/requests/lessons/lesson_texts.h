/// Converts profile and curriculum texts to the stores' records. Private to db/service.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "db/teaching/documents.h"
#include "needlelab/profile.pb.h"

namespace needlelab {

/// Validates and canonicalises a profile; `revision` is 0. `source` names the text in messages.
/// kInvalidInput.
Result<StoredProfile> storedProfileOf(std::string_view json, std::string_view source,
                                      const std::string& author, std::int64_t now_unix_ns);
/// Same for a curriculum; its requirements must name existing measures. Its exercises are stored as practised
/// in the course (exerciseInCourse); its own text stays the author's.
Result<StoredCurriculum> storedCurriculumOf(std::string_view json, std::string_view source,
                                            const std::string& author, std::int64_t now_unix_ns);

/// ": layers, name": the top-level fields that differ; empty when `before` is empty.
std::string changedFields(std::string_view before, std::string_view after);

/// A stored profile with the exercise's needle instead of its own. kInvalidInput: profile and needle do not
/// fit together.
Result<std::string> profileWithNeedle(const std::string& profile_json, const pb::Exercise& exercise);

/// Stores the samples embedded in the binary (db/samples/*.json). Call in a transaction of the writer.
Status storeSamples(Connection& writer, std::int64_t now_unix_ns);

}  // namespace needlelab
