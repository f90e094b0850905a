#include <algorithm>
#include <set>
#include <utility>
#include <vector>

#include "common/base/text/text.h"
#include "server/web/routes.h"

namespace needlelab {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;

constexpr std::string_view kMessages = "needlelab.pb.";

/// Schemas of texts that are JSON: rows of score_report.h, reference.h and progress.h in common/scoring.
constexpr const char* kInnerSchemas = R"json({
  "measures": {"type": ["array", "null"], "description": "null: there is none", "items": {"type": "object",
    "properties": {"measure": {"type": "string"}, "value": {"type": ["number", "null"]}, "unit": {"type": "string"},
      "min": {"type": "number"}, "max": {"type": "number"}, "passed": {"type": "boolean"}, "words": {"type": "string"}},
    "required": ["measure", "value", "unit", "words"], "additionalProperties": false}},
  "comparison": {"type": ["array", "null"], "description": "null: there is none", "items": {"type": "object",
    "properties": {"measure": {"type": "string"}, "value": {"type": "number"}, "unit": {"type": "string"},
      "n": {"type": "integer"}, "least": {"type": "number"}, "greatest": {"type": "number"},
      "place": {"enum": ["below", "within", "above", null], "description": "null: no statement"}, "better": {"type": "string"}, "words": {"type": "string"}},
    "required": ["measure", "value", "unit", "n", "least", "greatest", "place", "better", "words"],
    "additionalProperties": false}},
  "progress": {"type": ["array", "null"], "description": "null: there is none", "items": {"type": "object",
    "properties": {"measure": {"type": "string"}, "unit": {"type": "string"}, "better": {"type": "string"},
      "attempts": {"type": "array", "items": {"type": "integer"}},
      "values": {"type": "array", "items": {"type": ["number", "null"]}},
      "trend": {"type": ["object", "null"], "additionalProperties": false, "properties": {
        "slope_per_attempt": {"type": ["number", "null"]}, "tau": {"type": ["number", "null"]},
        "p": {"type": ["number", "null"]}}},
      "curve": {"type": ["object", "null"], "additionalProperties": false, "properties": {
        "end": {"type": ["number", "null"]}, "gain": {"type": ["number", "null"]},
        "attempts": {"type": ["number", "null"]}, "r_squared": {"type": ["number", "null"]}}},
      "words": {"type": "string"}},
    "required": ["measure", "unit", "better", "attempts", "values", "trend", "curve", "words"],
    "additionalProperties": false}}
})json";

/// The schema of each such field, by message and field.
constexpr std::pair<std::string_view, const char*> kInnerFields[] = {
    {"Score.measures_json", "measures"},    {"Score.comparison_json", "comparison"},
    {"SessionInfo.score_json", "measures"}, {"Attempt.score_json", "measures"},
    {"Progress.measures_json", "progress"},
};

/// Descriptions that do not follow from a route's messages: `body`, `reply`, whether If-Match is optional.
constexpr const char* kSpecialRoutes = R"json({
  "POST /session": {"body": {"type": "object", "properties": {"name": {"type": "string"}, "password": {"type": "string"}},
      "required": ["name", "password"], "additionalProperties": false},
    "reply": {"$ref": "#/components/schemas/LogIn"}},
  "GET /session": {"reply": {"$ref": "#/components/schemas/LogIn"}},
  "DELETE /session": {"reply": {"type": "object", "maxProperties": 0}},
  "GET /live": {"reply": null},
  "GET /openapi.json": {"reply": {"type": "object"}},
  "POST /people": {"reply": {"type": "object", "properties": {"name": {"type": "string"}, "role": {"$ref": "#/components/schemas/Role"}},
    "required": ["name", "role"], "additionalProperties": false}},
  "PATCH /people/{name}": {"body": {"type": "object"}, "if_match": "optional"},
  "GET /people/{name}/export": {"reply": {"type": "object", "properties": {"items": {"type": "array",
    "items": {"type": "object"}}}, "required": ["items"], "additionalProperties": false}},
  "POST /groups": {"body": {"type": "object"}},
  "PUT /groups/{id}": {"body": {"type": "object"}},
  "PUT /profiles/{id}": {"body": {"type": "object"}},
  "POST /profiles/check": {"body": {"type": "object"}},
  "POST /profiles/preview": {"body": {"type": "object"}},
  "PUT /courses/{id}": {"body": {"type": "object"}},
  "POST /courses/check": {"body": {"type": "object"}},
  "GET /measures": {"list_of": "Measures.measures"},
  "POST /assignments": {"reply": {"$ref": "#/components/schemas/Assignment"}},
  "GET /sessions/{id}/samples": {"reply": {"type": "object", "properties": {"rate_hz": {"type": "number"},
      "samples": {"type": "integer"}, "from_s": {"type": "number"}, "to_s": {"type": "number"},
      "decimated": {"type": "boolean"}, "columns": {"type": "object", "required": ["t_s", "force_n"],
        "additionalProperties": {"type": "array", "items": {"type": ["number", "null"]}}}},
    "required": ["rate_hz", "samples", "from_s", "to_s", "decimated", "columns"], "additionalProperties": false}},
  "GET /sessions/{id}/annotations": {"reply": {"type": "object", "properties": {
      "items": {"type": "array", "items": {"$ref": "#/components/schemas/Remark"}},
      "next_page": {"type": "string", "description": "for ?page=; empty: this was the last"}},
    "required": ["items", "next_page"], "additionalProperties": false}},
  "POST /sessions/{id}/annotations": {"body": {"type": "object", "properties": {"text": {"type": "string"},
      "t_s": {"type": "number"}}, "required": ["text", "t_s"], "additionalProperties": false},
    "reply": {"$ref": "#/components/schemas/Remark"}}
})json";

class Description {
 public:
  std::string text() {
    WebJson paths = WebJson::object();
    for (const WebRoute& route : webRoutes()) {
      paths[std::string(route.pattern)][lowerCase(route.method)] = operation(route);
    }
    addComponents();
    WebJson document = WebJson::parse(R"json({
      "openapi": "3.1.0",
      "info": {"title": "needlelab", "version": "1", "description": "Log in by POST /session; the cookie __Host-needlelab comes with the reply. Everything but GET needs the reply's csrf_token in X-CSRF-Token. Times are ms since 1970."},
      "servers": [{"url": "/api/v1"}],
      "security": [{"session": []}]
    })json");
    document["paths"] = std::move(paths);
    document["components"]["securitySchemes"]["session"] = {
        {"type", "apiKey"}, {"in", "cookie"}, {"name", "__Host-needlelab"}};
    document["components"]["schemas"] = std::move(components_);
    return document.dump(1) + "\n";
  }

 private:
  static std::string nameOf(const Descriptor& message) {
    std::string name = message.full_name().substr(kMessages.size());
    std::replace(name.begin(), name.end(), '.', '_');
    return name;
  }

  WebJson ref(const Descriptor& message) {
    if (named_.insert(nameOf(message)).second) wanted_.push_back(&message);
    return {{"$ref", "#/components/schemas/" + nameOf(message)}};
  }

  static WebJson enumSchema(const google::protobuf::EnumDescriptor& type) {
    WebJson names = WebJson::array();
    for (int i = 0; i < type.value_count(); ++i) names.push_back(type.value(i)->name());
    return {{"enum", std::move(names)}};
  }

  static bool isTime(const FieldDescriptor& field) { return ("_" + field.name()).ends_with("_unix_ns"); }
  static bool isJsonText(const FieldDescriptor& field) {
    return field.type() == FieldDescriptor::TYPE_STRING && !field.is_repeated() &&
           (field.name() == "json" || std::string_view(field.name()).ends_with("_json"));
  }

  /// The field's name in the output of reply_json.cpp.
  static std::string keyOf(const FieldDescriptor& field) {
    const std::string& name = field.name();
    if (isTime(field)) return name.substr(0, name.size() - 2) + "ms";
    if (isJsonText(field) && name != "json") return name.substr(0, name.size() - 5);
    return name;
  }

  /// The schema of one value, ignoring `repeated`.
  WebJson valueSchema(const FieldDescriptor& field) {
    if (isTime(field))
      return {{"type", {"number", "null"}}, {"description", "ms since 1970, null: not yet or never"}};
    if (isJsonText(field)) {
      const std::string path = field.full_name().substr(kMessages.size());
      for (const auto& [inner, schema] : kInnerFields)
        if (path == inner) return inner_[schema];
      return WebJson::object();
    }
    if (field.name() == "records") return {{"type", "object"}};
    switch (field.cpp_type()) {
      case FieldDescriptor::CPPTYPE_DOUBLE:
        return {{"type", {"number", "null"}}};
      case FieldDescriptor::CPPTYPE_FLOAT:
        return {{"type", "number"}};
      case FieldDescriptor::CPPTYPE_BOOL:
        return {{"type", "boolean"}};
      case FieldDescriptor::CPPTYPE_INT32:
      case FieldDescriptor::CPPTYPE_INT64:
        return {{"type", "integer"}};
      case FieldDescriptor::CPPTYPE_UINT32:
      case FieldDescriptor::CPPTYPE_UINT64:
        return {{"type", "integer"}, {"minimum", 0}};
      case FieldDescriptor::CPPTYPE_ENUM:
        return enumSchema(*field.enum_type());
      case FieldDescriptor::CPPTYPE_STRING: {
        WebJson schema = {{"type", "string"}};
        if (field.name() == "session_id" || field.name() == "session_ids") schema["format"] = "uuid";
        return schema;
      }
      case FieldDescriptor::CPPTYPE_MESSAGE:
        return ref(*field.message_type());
    }
    return WebJson::object();
  }

  WebJson fieldSchema(const FieldDescriptor& field) {
    if (!field.is_repeated()) return valueSchema(field);
    return {{"type", "array"}, {"items", valueSchema(field)}};
  }

  /// True if reply_json.cpp always writes the field. False for inner JSON texts, because lists omit some.
  static bool isRequired(const FieldDescriptor& field) {
    return field.is_repeated() || (!field.has_presence() && !isJsonText(field));
  }

  WebJson messageSchema(const Descriptor& message) {
    WebJson properties = WebJson::object(), required = WebJson::array();
    for (int i = 0; i < message.field_count(); ++i) {
      const FieldDescriptor& field = *message.field(i);
      properties[keyOf(field)] = fieldSchema(field);
      if (isRequired(field)) required.push_back(keyOf(field));
    }
    WebJson schema = {{"type", "object"}, {"properties", std::move(properties)}};
    if (!required.empty()) schema["required"] = std::move(required);
    schema["additionalProperties"] = false;
    return schema;
  }

  WebJson listSchema(const FieldDescriptor& rows) {
    WebJson properties = {
        {"items", {{"type", "array"}, {"items", valueSchema(rows)}}},
        {"next_page", {{"type", "string"}, {"description", "for ?page=; empty: this was the last"}}}};
    WebJson required = WebJson::array({"items", "next_page"});
    const Descriptor& message = *rows.containing_type();
    for (int i = 0; i < message.field_count(); ++i) {
      const FieldDescriptor& field = *message.field(i);
      if (&field == &rows || field.name() == "next_page") continue;
      properties[keyOf(field)] = fieldSchema(field);
      if (!field.has_presence()) required.push_back(keyOf(field));
    }
    return {{"type", "object"},
            {"properties", std::move(properties)},
            {"required", std::move(required)},
            {"additionalProperties", false}};
  }

  WebJson replySchema(const WebRoute& route, const WebJson& special) {
    if (special.contains("reply")) return special["reply"];
    const Descriptor& message =
        *pb::Reply::descriptor()->FindFieldByNumber(requestRow(route.call)->reply)->message_type();
    if (message.field_count() == 0) return {{"type", "object"}, {"maxProperties", 0}};
    const FieldDescriptor* rows =
        special.contains("list_of") ? message.FindFieldByName("measures") : rowsOf(message);
    return rows != nullptr ? listSchema(*rows) : ref(message);
  }

  /// Null if the route has no body.
  WebJson bodySchema(const WebRoute& route, const WebJson& special) {
    if (special.contains("body")) return special["body"];
    if (route.call == pb::Request::CALL_NOT_SET || route.how.action != WebAction::kRequest) return nullptr;
    const auto fields = plainFieldsOf(route).body;
    if (fields.empty()) return nullptr;
    WebJson properties = WebJson::object();
    for (const FieldDescriptor* field : fields) properties[keyOf(*field)] = fieldSchema(*field);
    return {{"type", "object"}, {"properties", std::move(properties)}, {"additionalProperties", false}};
  }

  static WebJson parameter(std::string_view name, const char* in) {
    WebJson made = {{"name", name}, {"in", in}};
    if (std::string_view(in) != "query") made["required"] = true;
    made["schema"] = {{"type", "string"}};
    return made;
  }

  WebJson parametersOf(const WebRoute& route, const WebJson& special) {
    WebJson all = WebJson::array();
    for (std::size_t at = route.pattern.find('{'); at != std::string_view::npos;
         at = route.pattern.find('{', at + 1))
      all.push_back(parameter(route.pattern.substr(at + 1, route.pattern.find('}', at) - at - 1), "path"));
    for (const std::string_view name : route.query) all.push_back(parameter(name, "query"));
    const bool plain = route.call != pb::Request::CALL_NOT_SET && route.method != "POST";
    if (special.contains("if_match") || (plain && plainFieldsOf(route).base != nullptr)) {
      WebJson if_match = parameter("If-Match", "header");
      if_match["required"] = !special.contains("if_match");
      if_match["description"] =
          "the revision that was changed, in quotes; 409 with current_revision when it is not the newest";
      all.push_back(std::move(if_match));
    }
    if (route.method != "GET" && route.how.action != WebAction::kLogIn)
      all.push_back(parameter("X-CSRF-Token", "header"));
    return all;
  }

  /// "GET /people/{name}/mentions": "getPeopleNameMentions".
  static std::string operationIdOf(const WebRoute& route) {
    std::string id = lowerCase(route.method);
    bool begins = true;
    for (const char c : route.pattern) {
      const bool is_word = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
      if (is_word) id += begins && c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c;
      begins = !is_word;
    }
    return id;
  }
  /// The first part of the address: "people".
  static std::string tagOf(const WebRoute& route) {
    const std::string_view path = route.pattern.substr(1);
    return std::string(path.substr(0, path.find_first_of("/.")));
  }

  /// Without parameters such as charset.
  static std::string mediaTypeOf(const ExportFormat& format) {
    return std::string(format.media_type.substr(0, format.media_type.find(';')));
  }

  WebJson operation(const WebRoute& route) {
    const std::string line = std::string(route.method) + " " + std::string(route.pattern);
    const WebJson special = special_.value(line, WebJson::object());
    WebJson made = {{"operationId", operationIdOf(route)},
                    {"tags", WebJson::array({tagOf(route)})},
                    {"summary", route.summary}};
    if (auto parameters = parametersOf(route, special); !parameters.empty())
      made["parameters"] = std::move(parameters);
    if (auto body = bodySchema(route, special); !body.is_null())
      made["requestBody"] = {{"required", true}, {"content", {{"application/json", {{"schema", body}}}}}};
    WebJson done = {{"description", route.summary}};
    if (route.format != nullptr)
      done["content"][mediaTypeOf(*route.format)] = WebJson::object();
    else if (const WebJson reply = replySchema(route, special); !reply.is_null())
      done["content"]["application/json"]["schema"] = reply;
    made["responses"][std::to_string(route.how.status)] = std::move(done);
    made["responses"]["default"] = {
        {"description", "Refused"},
        {"content", {{"application/json", {{"schema", {{"$ref", "#/components/schemas/Refused"}}}}}}}};
    if (route.how.action == WebAction::kLogIn) made["security"] = WebJson::array();
    return made;
  }

  /// Adds all referenced schemas, recursively.
  void addComponents() {
    components_["Refused"] =
        WebJson::parse(R"json({"type": "object", "properties": {"error": {"type": "object",
      "properties": {"code": {"type": "string"}, "message": {"type": "string"}, "field": {"type": "string"},
        "current_revision": {"type": "integer"}}, "required": ["code", "message"], "additionalProperties": false}},
      "required": ["error"], "additionalProperties": false})json");
    components_["LogIn"] = WebJson::parse(R"json({"type": "object", "properties": {"name": {"type": "string"},
      "full_name": {"type": "string"}, "role": {"$ref": "#/components/schemas/Role"}, "csrf_token": {"type": "string"},
      "expires_unix_ms": {"type": "number"}, "disk_room": {"type": "object", "description": "for administrators",
        "properties": {"level": {"type": "string", "enum": ["plenty", "no_new_sessions", "no_chunks", "read_only"]},
          "left_bytes": {"type": "integer"}}, "required": ["level"], "additionalProperties": false},
      "store": {"type": "object", "description": "for administrators", "properties": {
          "ack_survives": {"type": "string", "enum": ["nothing", "the end of a program", "a power cut", "the loss of a disk"]},
          "refused": {"type": "string", "description": "why the last change, or one of the last 30 s, was not stored"},
          "lack": {"type": "string", "description": "what the database lacks of what was acknowledged"},
          "waits_s": {"type": "number", "description": "how long a change has waited to be confirmed"}},
        "required": ["ack_survives"], "additionalProperties": false}},
      "required": ["name", "full_name", "role", "csrf_token", "expires_unix_ms"], "additionalProperties": false})json");
    components_["Role"] = enumSchema(*pb::Role_descriptor());
    // a remark at its time in the recording
    WebJson remark = messageSchema(*pb::Annotation::descriptor());
    remark["properties"]["t_s"] = {{"type", "number"}};
    remark["required"].push_back("t_s");
    components_["Remark"] = std::move(remark);
    (void)ref(*pb::Assignment::descriptor());
    for (std::size_t i = 0; i < wanted_.size(); ++i)
      components_[nameOf(*wanted_[i])] = messageSchema(*wanted_[i]);
  }

  const WebJson inner_ = WebJson::parse(kInnerSchemas);
  const WebJson special_ = WebJson::parse(kSpecialRoutes);
  std::set<std::string> named_;
  std::vector<const Descriptor*> wanted_;
  WebJson components_ = WebJson::object();
};

}  // namespace

std::string_view openApiText() {
  static const std::string text = Description().text();
  return text;
}

}  // namespace needlelab
