#include "server/base/http_message.h"

#include "common/base/text/plain_words.h"

namespace needlelab {
namespace {

bool isPathChar(char c) {
  return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_' || c == '.' || c == '[' || c == ']';
}

}  // namespace

HttpAnswer jsonAnswer(const WebJson& json, unsigned status) {
  HttpAnswer answer;
  answer.status = status;
  answer.body = json.dump(-1, ' ', false, WebJson::error_handler_t::replace) + "\n";
  return answer;
}

HttpAnswer errorAnswer(unsigned status, std::string_view code, const std::string& message,
                       const std::string& field) {
  WebJson error = {{"code", code}, {"message", plainWords(message)}};
  if (!field.empty()) error["field"] = field;
  return jsonAnswer({{"error", error}}, status);
}

HttpAnswer errorAnswer(const Error& error) {
  switch (error.code) {
    case ErrorCode::kInvalidInput:
      return errorAnswer(400, "invalid_input", error.message, fieldOfMessage(error.message));
    case ErrorCode::kNotFound:
      return errorAnswer(404, "not_found", error.message);
    case ErrorCode::kAlreadyExists:
      return errorAnswer(409, "already_exists", error.message);
    case ErrorCode::kConflict: {
      WebJson fault = {{"code", "conflict"},
                       {"message", plainWords(error.message)},
                       {"current_revision", error.current_revision}};
      return jsonAnswer({{"error", std::move(fault)}}, 409);
    }
    case ErrorCode::kDenied:
      return errorAnswer(403, "denied", error.message);
    case ErrorCode::kCode:
      return errorAnswer(403, "code", error.message);
    case ErrorCode::kDeposed:
    case ErrorCode::kUnavailable: {
      HttpAnswer answer = errorAnswer(503, "unavailable", error.message);
      answer.headers.emplace_back("Retry-After", "5");
      return answer;
    }
    case ErrorCode::kNoRoom: {
      HttpAnswer answer = errorAnswer(503, "no_room", error.message);
      answer.headers.emplace_back("Retry-After", "60");
      return answer;
    }
    case ErrorCode::kCorrupt:
      return errorAnswer(500, "corrupt", error.message);
    case ErrorCode::kVersion:
    case ErrorCode::kFailed:
      break;
  }
  return errorAnswer(500, "failed", error.message);
}

HttpAnswer plainAnswer(unsigned status, const std::string& text) {
  HttpAnswer answer;
  answer.status = status;
  answer.type = "text/plain; charset=utf-8";
  answer.body = text + "\n";
  return answer;
}

std::string fieldOfMessage(std::string_view message) {
  // the path may follow a source's name: "profile: layers[2].thickness_m: …"
  std::string field;
  for (int i = 0; i < 2; ++i) {
    const std::size_t end = message.find(": ");
    if (end == std::string_view::npos || end == 0 || end > 200) break;
    const std::string_view path = message.substr(0, end);
    bool fits = path.front() >= 'a' && path.front() <= 'z';
    for (const char c : path) fits = fits && isPathChar(c);
    if (!fits) break;
    field = path;
    message.remove_prefix(end + 2);
  }
  return field;
}

}  // namespace needlelab
