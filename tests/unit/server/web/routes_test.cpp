#include "server/web/routes.h"

#include <gtest/gtest.h>

#include <set>

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
  // A fixed part has priority over a name.
  EXPECT_EQ(matchOf("POST", "/profiles/check").route->pattern, "/profiles/check");
  EXPECT_EQ(matchOf("HEAD", "/sessions/x/samples.csv").route->method, "GET");
}

TEST(Routes, anUnknownPathHasNoMethodsAKnownOneListsThem) {
  EXPECT_TRUE(matchOf("GET", "/nothing").allowed.empty());
  EXPECT_TRUE(matchOf("GET", "/people/anna/nothing").allowed.empty());
  EXPECT_TRUE(matchOf("GET", "/sessions/").allowed.empty());
  const auto wrong = matchOf("PUT", "/session");
  EXPECT_EQ(wrong.route, nullptr);
  EXPECT_EQ(std::set<std::string>(wrong.allowed.begin(), wrong.allowed.end()),
            (std::set<std::string>{"POST", "GET", "HEAD", "DELETE"}));
}

TEST(Routes, eachExistsOnceWithWhatItsActionNeeds) {
  std::set<std::pair<std::string, std::string>> seen;
  for (const WebRoute& route : webRoutes()) {
    EXPECT_TRUE(seen.emplace(route.method, route.pattern).second) << route.method << " " << route.pattern;
    const RouteAdapter& how = route.how;
    const bool has = how.action == WebAction::kRequest  ? how.build != nullptr && how.shape != nullptr
                     : how.action == WebAction::kWork   ? how.work != nullptr
                     : how.action == WebAction::kSteps  ? how.steps != nullptr
                     : how.action == WebAction::kStream ? how.stream != nullptr
                                                        : true;
    EXPECT_TRUE(has) << route.method << " " << route.pattern;
    // The service's table of roles checks the routes that call the service.
    if (how.action == WebAction::kRequest || how.action == WebAction::kWork ||
        how.action == WebAction::kSteps || how.action == WebAction::kStream) {
      EXPECT_NE(route.call, pb::Request::CALL_NOT_SET) << route.pattern;
    }
    // each is reached by its own pattern
    EXPECT_EQ(matchOf(std::string(route.method), std::string(route.pattern)).route, &route) << route.pattern;
  }
}

TEST(Routes, takeABodyWhereTheDescriptionHasOne) {
  const json api = json::parse(openApiText());
  for (const WebRoute& route : webRoutes()) {
    std::string method(route.method);
    for (char& c : method) c = static_cast<char>(std::tolower(c));
    EXPECT_EQ(acceptsBody(route), api["paths"][std::string(route.pattern)][method].contains("requestBody"))
        << route.method << " " << route.pattern;
  }
}

TEST(Routes, eachAdapterIsOfARow) {
  for (const RouteAdapter& adapter : routeAdapters()) {
    std::vector<std::string> lines = {std::string(adapter.line)};
    if (adapter.place) {
      lines.clear();
      ASSERT_TRUE(adapter.line.ends_with(".*")) << adapter.line;
      for (const ExportFormat* format : formatsAt(*adapter.place))
        lines.push_back(std::string(adapter.line.substr(0, adapter.line.size() - 2)) +
                        std::string(format->suffix));
    }
    for (const std::string& line : lines) {
      int rows = 0;
      for (const WebRoute& route : webRoutes())
        rows += line == std::string(route.method) + " " + std::string(route.pattern);
      EXPECT_EQ(rows, 1) << line;
    }
  }
}

TEST(Routes, aPlainOneHasFieldsForPartsAndQueryNames) {
  using google::protobuf::FieldDescriptor;
  std::size_t plain = 0;
  for (const WebRoute& route : webRoutes()) {
    if (route.how.action != WebAction::kRequest || route.how.build != plainRequest) continue;
    ++plain;
    const PlainFields fields = plainFieldsOf(route);
    for (const auto& list : {fields.parts, fields.query})
      for (const FieldDescriptor* field : list) {
        ASSERT_NE(field, nullptr) << route.method << " " << route.pattern;
        EXPECT_TRUE(
            field->type() == FieldDescriptor::TYPE_STRING || field->type() == FieldDescriptor::TYPE_BYTES ||
            field->type() == FieldDescriptor::TYPE_UINT32 || field->type() == FieldDescriptor::TYPE_BOOL)
            << route.method << " " << route.pattern << ": " << field->name();
      }
  }
  EXPECT_GT(plain, 30u);
}

TEST(Routes, plainOnesFillTheirCallFromAddressQueryBodyAndIfMatch) {
  const auto built = [](const std::string& method, const std::string& path, WebCall call) {
    const WebMatch match = matchOf(method, path);
    call.parts = match.parts;
    return match.route->how.build(*match.route, call);
  };
  WebCall call;
  call.target.query = {{"exercise", "e1"}, {"page", "AQI"}};
  const auto progress = built("GET", "/people/tina/progress", call);
  EXPECT_EQ(progress->get_progress().trainee(), "tina");
  EXPECT_EQ(progress->get_progress().exercise_id(), "e1");
  EXPECT_EQ(progress->get_progress().page(), "\x01\x02");

  call = {};
  call.target.query = {{"brief", "yes"}, {"limit", "7"}, {"search", "a"}};
  EXPECT_TRUE(built("GET", "/groups", call)->list_groups().brief());
  EXPECT_EQ(built("GET", "/groups", call)->list_groups().limit(), 7u);
  EXPECT_EQ(built("GET", "/groups", call)->list_groups().search(), "a");
  call.target.query["brief"] = "no";
  EXPECT_FALSE(built("GET", "/groups", call)->list_groups().brief());
  call.target.query["brief"] = "true";
  EXPECT_EQ(built("GET", "/groups", call).error().code, ErrorCode::kInvalidInput);

  call = {};
  call.target.query = {{"definition_version", "3"}};
  const std::string id = "018f3a5e-0000-7000-8000-000000000001";
  const auto score = built("GET", "/sessions/" + id + "/score", call);
  EXPECT_EQ(score->get_score().session_id().size(), 16u);
  EXPECT_EQ(score->get_score().definition_version(), 3u);
  EXPECT_EQ(built("GET", "/sessions/none/score", call).error().code, ErrorCode::kNotFound);
  call.target.query = {{"definition_version", "0"}};
  EXPECT_EQ(built("GET", "/sessions/" + id + "/score", call).error().code, ErrorCode::kInvalidInput);

  call = {};
  call.body = {{"excused", true}, {"reason", "power"}};
  const auto excuse = built("POST", "/sessions/" + id + "/excuse", call);
  EXPECT_TRUE(excuse->excuse_attempt().excused());
  EXPECT_EQ(excuse->excuse_attempt().session_id(), score->get_score().session_id());
  call.body["session_id"] = id;
  EXPECT_EQ(built("POST", "/sessions/" + id + "/excuse", call).error().code, ErrorCode::kInvalidInput);

  call = {};
  call.body = {{"trainee", "tom"}, {"reason", "a typing error"}, {"was", "tmo"}};
  const auto assign = built("POST", "/sessions/" + id + "/trainee", call);
  EXPECT_EQ(assign->assign_session().trainee(), "tom");
  EXPECT_EQ(assign->assign_session().was(), "tmo");
  EXPECT_EQ(assign->assign_session().session_id(), score->get_score().session_id());
  call = {};
  call.target.query = {{"page", "AQI"}};
  const auto unknown = built("GET", "/unknown-trainees", call);
  EXPECT_TRUE(unknown->list_sessions().unknown_trainee());
  EXPECT_EQ(unknown->list_sessions().page(), "\x01\x02");

  call = {};
  EXPECT_EQ(built("DELETE", "/groups/g1", call).error().code, ErrorCode::kInvalidInput);
  call.if_match = 7;
  EXPECT_EQ(built("DELETE", "/groups/g1", call)->remove_group().id(), "g1");
  EXPECT_EQ(built("DELETE", "/groups/g1", call)->remove_group().base_revision(), 7u);
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
