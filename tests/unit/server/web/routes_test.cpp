#include "server/web/routes.h"

#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <set>
#include <sstream>

#include "server/web/openapi.h"
#include "tests/unit/server/web/json_schema.h"

namespace needlelab {
namespace {

using nlohmann::json;

std::vector<std::string> segmentsOf(const std::string& path) {
  std::vector<std::string> parts;
  for (std::size_t at = 0; at < path.size();) {
    const std::size_t end = std::min(path.find('/', at + 1), path.size());
    parts.push_back(path.substr(at + 1, end - at - 1));
    at = end;
  }
  return parts;
}

WebMatch matchOf(const std::string& method, const std::string& path) {
  return matchRoute(method, segmentsOf(path));
}

TEST(Routes, aPathFindsItsPatternAndItsParts) {
  EXPECT_EQ(matchOf("GET", "/people").route->pattern, "/people");
  const auto one = matchOf("GET", "/people/anna");
  EXPECT_EQ(one.route->pattern, "/people/{name}");
  EXPECT_EQ(one.parts, std::vector<std::string>{"anna"});
  // a fixed part goes before a name
  EXPECT_EQ(matchOf("POST", "/profiles/check").route->pattern, "/profiles/check");
  EXPECT_EQ(matchOf("HEAD", "/sessions/x/samples.csv").route->method, "GET");
}

TEST(Routes, anUnknownPathHasNoMethodsAndAKnownOneSaysWhich) {
  EXPECT_TRUE(matchOf("GET", "/nothing").allowed.empty());
  EXPECT_TRUE(matchOf("GET", "/people/anna/nothing").allowed.empty());
  EXPECT_TRUE(matchOf("GET", "/sessions/").allowed.empty());
  const auto wrong = matchOf("PUT", "/session");
  EXPECT_EQ(wrong.route, nullptr);
  EXPECT_EQ(std::set<std::string>(wrong.allowed.begin(), wrong.allowed.end()),
            (std::set<std::string>{"POST", "GET", "HEAD", "DELETE"}));
}

TEST(Routes, eachIsThereOnceAndHasWhatItsActionNeeds) {
  std::set<std::pair<std::string, std::string>> seen;
  for (const WebRoute& route : webRoutes()) {
    EXPECT_TRUE(seen.emplace(route.method, route.pattern).second) << route.method << " " << route.pattern;
    const bool has = route.action == WebAction::kRequest  ? route.build != nullptr && route.shape != nullptr
                     : route.action == WebAction::kWork   ? route.work != nullptr
                     : route.action == WebAction::kStream ? route.stream != nullptr
                     : route.action == WebAction::kText   ? route.text != nullptr
                                                          : true;
    EXPECT_TRUE(has) << route.method << " " << route.pattern;
    // what asks the service is checked by its table of roles
    if (route.action == WebAction::kRequest || route.action == WebAction::kWork ||
        route.action == WebAction::kStream) {
      EXPECT_NE(route.call, pb::Request::CALL_NOT_SET) << route.pattern;
    }
    // each is reached by its own pattern
    EXPECT_EQ(matchOf(std::string(route.method), std::string(route.pattern)).route, &route) << route.pattern;
  }
}

struct RouteBefore {
  std::string method, path, role_of, status, query;
};
std::vector<RouteBefore> routesBefore() {
  std::ifstream in(NEEDLELAB_SOURCE_DIR "/tests/unit/server/web/routes_before.tsv");
  std::vector<RouteBefore> rows;
  for (std::string line; std::getline(in, line);) {
    if (line.starts_with("#") || line.starts_with("method\t")) continue;
    std::istringstream cells(line);
    RouteBefore row;
    for (std::string* cell : {&row.method, &row.path, &row.role_of, &row.status, &row.query})
      std::getline(cells, *cell, '\t');
    rows.push_back(std::move(row));
  }
  return rows;
}

TEST(Routes, areThoseOfBefore) {
  // of one path in their order, in which a refused method names them
  std::map<std::string, std::vector<std::string>> expected, found;
  for (const RouteBefore& row : routesBefore()) expected[row.path].push_back(row.method + " " + row.role_of);
  const auto& calls = *pb::Request::descriptor();
  for (const WebRoute& route : webRoutes()) {
    const auto* call = calls.FindFieldByNumber(route.call);
    found[std::string(route.pattern)].push_back(std::string(route.method) + " " +
                                                (call == nullptr ? "-" : call->name()));
  }
  EXPECT_EQ(found, expected);
}

TEST(OpenApi, describesTheRoutesOfBefore) {
  const json api = json::parse(openApiText());
  std::size_t operations = 0;
  for (const auto& [pattern, methods] : api["paths"].items()) operations += methods.size();
  EXPECT_EQ(operations, routesBefore().size());
  for (const RouteBefore& row : routesBefore()) {
    std::string method = row.method;
    for (char& c : method) c = static_cast<char>(std::tolower(c));
    ASSERT_TRUE(api["paths"].contains(row.path) && api["paths"][row.path].contains(method)) << row.path;
    const json& operation = api["paths"][row.path][method];
    EXPECT_TRUE(operation["responses"].contains(row.status)) << row.method << " " << row.path;
    EXPECT_EQ(operation["responses"].size(), 2u) << row.method << " " << row.path;
    std::string query;
    for (const json& parameter : operation.value("parameters", json::array()))
      if (parameter["in"] == "query")
        query += (query.empty() ? "" : " ") + parameter["name"].get<std::string>();
    EXPECT_EQ(query.empty() ? "-" : query, row.query) << row.method << " " << row.path;
  }
}

TEST(OpenApi, describesEveryRouteAndNoOther) {
  const json api = json::parse(openApiText(), nullptr, false);
  ASSERT_FALSE(api.is_discarded());
  EXPECT_EQ(api["openapi"], "3.1.0");
  std::set<std::string> routes, described;
  for (const WebRoute& route : webRoutes()) {
    std::string method(route.method);
    for (char& c : method) c = static_cast<char>(std::tolower(c));
    routes.insert(method + " " + std::string(route.pattern));
  }
  for (const auto& [pattern, methods] : api["paths"].items())
    for (const auto& [method, operation] : methods.items()) {
      described.insert(method + " " + pattern);
      // every {part} is described
      for (const auto& segment : segmentsOf(pattern)) {
        if (segment.front() != '{') continue;
        bool found = false;
        for (const json& parameter : operation.value("parameters", json::array()))
          found = found ||
                  (parameter["in"] == "path" && "{" + parameter["name"].get<std::string>() + "}" == segment);
        EXPECT_TRUE(found) << pattern;
      }
    }
  EXPECT_EQ(routes, described);
}

TEST(JsonSchema, findsWhatDoesNotFit) {
  const json root = {{"components", {{"schemas", {{"N", {{"type", "integer"}, {"minimum", 0}}}}}}}};
  const json schema = json::parse(R"({"type": "object", "required": ["a"], "additionalProperties": false,
      "properties": {"a": {"type": "array", "items": {"$ref": "#/components/schemas/N"}}, "b": {"enum": ["x"]}}})");
  EXPECT_EQ(test::schemaFault(schema, {{"a", {1, 2}}, {"b", "x"}}, root), "");
  for (const json& wrong :
       {json::parse(R"({})"), json::parse(R"({"a": [1, -1]})"), json::parse(R"({"a": [1.5]})"),
        json::parse(R"({"a": [], "b": "y"})"), json::parse(R"({"a": [], "c": 1})"), json(3)})
    EXPECT_NE(test::schemaFault(schema, wrong, root), "") << wrong.dump();
}

}  // namespace
}  // namespace needlelab
