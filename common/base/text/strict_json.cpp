#include "common/base/text/strict_json.h"

#include <fmt/core.h>

#include <vector>

namespace needlelab {
namespace {

using nlohmann::json;

constexpr std::size_t kMaxDepth = 32;
constexpr std::size_t kMaxWords = 300;

/// Receives the parser's events, builds the tree, and tracks the path of the current value.
// NOLINTNEXTLINE(bugprone-exception-escape): running out of memory ends the program anyway
class TreeBuilder : public nlohmann::json_sax<json> {
 public:
  bool null() override { return put(nullptr); }
  bool boolean(bool value) override { return put(value); }
  bool number_integer(number_integer_t value) override { return put(value); }
  bool number_unsigned(number_unsigned_t value) override { return put(value); }
  bool number_float(number_float_t value, const string_t& /*text*/) override { return put(value); }
  bool string(string_t& value) override { return put(std::move(value)); }
  bool binary(binary_t& /*value*/) override { return fail("binary values are not JSON"); }
  bool start_object(std::size_t /*size*/) override { return open(json::object()); }
  bool start_array(std::size_t /*size*/) override { return open(json::array()); }
  bool end_object() override { return close(); }
  bool end_array() override { return close(); }

  bool key(string_t& name) override {
    frames_.back().key = name;
    if (frames_.back().node->contains(name)) return fail("is given twice");
    return true;
  }

  bool parse_error(std::size_t /*position*/, const std::string& last_token,
                   const json::exception& error) override {
    // the library's text without its prefix "[json.exception.…] "
    std::string words = error.what();
    if (const auto end = words.find("] "); words.starts_with("[") && end != std::string::npos) {
      words.erase(0, end + 2);
    }
    if (words.size() > kMaxWords) words = words.substr(0, kMaxWords) + " …";
    constexpr int kNumberOverflow = 406;
    if (error.id == kNumberOverflow) return fail(last_token.substr(0, 60) + " is too large for a number");
    return fail("not valid JSON: " + words);
  }

  [[nodiscard]] const std::string& fault() const { return fault_; }
  json takeTree() { return std::move(root_); }

 private:
  struct Frame {
    json* node;
    std::string key;  // of the current member, if `node` is an object
  };

  // inserts a value at the current place and returns the place
  json* place(json value) {
    if (frames_.empty()) {
      root_ = std::move(value);
      return &root_;
    }
    Frame& top = frames_.back();
    if (top.node->is_array()) {
      top.node->push_back(std::move(value));
      return &top.node->back();
    }
    json& member = (*top.node)[top.key];
    member = std::move(value);
    return &member;
  }
  bool put(json value) {
    place(std::move(value));
    return true;
  }
  bool open(json value) {
    if (frames_.size() >= kMaxDepth) return fail(fmt::format("is nested deeper than {}", kMaxDepth));
    json* node = place(std::move(value));
    frames_.push_back({node, {}});
    return true;
  }
  bool close() {
    frames_.pop_back();
    return true;
  }
  bool fail(const std::string& words) {
    const std::string path = pathText();
    fault_ = path.empty() ? words : path + ": " + words;
    return false;
  }
  [[nodiscard]] std::string pathText() const {
    std::string path;
    for (const Frame& frame : frames_) {
      if (frame.node->is_array()) {
        // the current item: not in the list yet, unless it is a list or object still being read
        const bool is_open = &frame != &frames_.back();
        path += fmt::format("[{}]", frame.node->size() - (is_open ? 1 : 0));
      } else if (!frame.key.empty()) {
        // ordinary names stay as they are, all others are quoted
        const bool plain =
            frame.key.size() <= 60 &&
            frame.key.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-") ==
                std::string::npos;
        path += (path.empty() ? "" : ".") + (plain ? frame.key : quotedText(frame.key));
      }
    }
    return path;
  }

  json root_;
  std::vector<Frame> frames_;
  std::string fault_;
};

}  // namespace

std::string quotedText(std::string_view text) {
  constexpr std::size_t kMax = 60;
  std::string whole =
      json(std::string(text.substr(0, kMax))).dump(-1, ' ', true, json::error_handler_t::replace);
  return text.size() > kMax ? whole + "…" : whole;
}

Result<json> readStrictJson(std::string_view text, std::string_view source, std::size_t max_bytes) {
  const std::string name(source);
  if (text.size() > max_bytes) {
    return Error{ErrorCode::kInvalidInput, name + ": " + std::to_string(text.size()) +
                                               " bytes are too many, at most " + std::to_string(max_bytes) +
                                               " are read"};
  }
  TreeBuilder builder;
  if (!json::sax_parse(text, &builder)) return Error{ErrorCode::kInvalidInput, name + ": " + builder.fault()};
  return builder.takeTree();
}

Error fieldError(const std::string& path, const std::string& words) {
  return {ErrorCode::kInvalidInput, path.empty() ? words : path + ": " + words};
}

}  // namespace needlelab
