// Mutates a JSON text so that it stays valid JSON. libFuzzer's own byte mutations mostly fail in the parser.
#include <cstring>
#include <nlohmann/json.hpp>
#include <random>
#include <utility>
#include <vector>

#include "tests/fuzz/target.h"

namespace needlelab::fuzz {
namespace {

using Json = nlohmann::json;
using Draws = std::minstd_rand;

std::size_t below(Draws& random, std::size_t count) {
  return random() % count;
}

void gather(Json& node, std::vector<Json*>& all) {
  all.push_back(&node);
  if (node.is_structured())
    for (Json& child : node) gather(child, all);
}

void changeText(std::string& text, Draws& random) {
  switch (below(random, 4)) {
    case 0:
      text.insert(below(random, text.size() + 1), 1 + below(random, 100),
                  static_cast<char>('!' + below(random, 94)));
      break;
    case 1:
      text.resize(below(random, text.size() + 1));
      break;
    case 2:
      text += text;
      break;
    default:
      if (!text.empty()) text[below(random, text.size())] = static_cast<char>(' ' + below(random, 95));
  }
}

void changeNumber(Json& node, Draws& random) {
  const double was = node.get<double>();
  const double becomes[] = {0,       -1,     1,     -was,         2 * was,   was / 2,
                            was + 1, 1e-300, 1e300, 4294967296.0, was * 1000};
  const std::size_t which = below(random, std::size(becomes) + 2);
  if (which < std::size(becomes))
    node = becomes[which];
  else
    node = which % 2 == 0 ? Json(static_cast<std::int64_t>(below(random, 200)) - 100) : Json(INT64_MAX);
}

void changeArray(Json& node, Draws& random) {
  if (node.empty()) return;
  const std::size_t i = below(random, node.size());
  const Json element = node[i];
  const std::size_t times = 1 + below(random, 70);
  switch (below(random, 4)) {
    case 0:
      node.erase(i);
      break;
    case 1:
      for (std::size_t n = 0; n < times; ++n) node.push_back(element);
      break;
    case 2:
      node.insert(node.begin() + static_cast<std::ptrdiff_t>(below(random, node.size() + 1)), element);
      break;
    default:
      std::swap(node[i], node[below(random, node.size())]);
  }
}

void changeObject(Json& node, const Json& other, Draws& random) {
  if (node.empty()) return;
  const auto at = std::next(node.begin(), static_cast<std::ptrdiff_t>(below(random, node.size())));
  const std::string key = at.key();
  if (below(random, 2) == 0)
    node.erase(key);
  else if (other.is_object())
    node.update(Json(other));
  else
    node[key] = Json(other);
}

}  // namespace

std::size_t mutateJson(std::span<std::uint8_t> room, std::size_t size, unsigned seed) {
  Json whole = Json::parse(room.begin(), room.begin() + static_cast<std::ptrdiff_t>(size), nullptr, false);
  if (whole.is_discarded()) return 0;
  Draws random(seed);
  for (std::size_t changes = 1 + below(random, 3); changes > 0; --changes) {
    std::vector<Json*> all;
    gather(whole, all);
    Json& node = *all[below(random, all.size())];
    const Json other = *all[below(random, all.size())];
    if (below(random, 8) == 0)
      node = other;
    else if (node.is_string())
      changeText(node.get_ref<std::string&>(), random);
    else if (node.is_number())
      changeNumber(node, random);
    else if (node.is_boolean())
      node = !node.get<bool>();
    else if (node.is_array())
      changeArray(node, random);
    else if (node.is_object())
      changeObject(node, other, random);
  }
  const std::string text = whole.dump(-1, ' ', false, Json::error_handler_t::replace);
  if (text.empty() || text.size() > room.size()) return 0;
  std::memcpy(room.data(), text.data(), text.size());
  return text.size();
}

}  // namespace needlelab::fuzz
