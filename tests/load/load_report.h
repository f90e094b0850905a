/// A run as JSON (DESIGN §9) and in words.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "tests/load/load_run.h"

namespace needlelab::test {

nlohmann::ordered_json loadJson(const LoadResult& result);
/// Some lines for a person; the last is the verdict.
std::string loadText(const LoadResult& result);

}  // namespace needlelab::test
