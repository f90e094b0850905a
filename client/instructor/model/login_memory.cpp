#include "client/instructor/model/login_memory.h"

#include <nlohmann/json.hpp>

#include "common/base/files.h"
#include "common/base/text.h"

namespace needlelab {

void recallLogin(const std::filesystem::path& file, LoginForm& form) {
  const auto text = readWholeFile(file, 1u << 16);
  if (!text.ok()) return;
  const auto json = nlohmann::json::parse(*text, nullptr, false);
  if (!json.is_object()) return;
  const auto take = [&](const char* key, std::string& field) {
    const auto found = json.find(key);
    if (found != json.end() && found->is_string()) field = printable(found->get<std::string>());
  };
  take("server", form.server);
  take("ca_file", form.ca_file);
  take("user", form.user);
}

Status rememberLogin(const std::filesystem::path& file, const LoginForm& form) {
  const nlohmann::ordered_json json = {
      {"server", form.server}, {"ca_file", form.ca_file}, {"user", form.user}};
  const std::string text = json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
  return writeFileAtomically(file, viewOf(text), 0600);
}

}  // namespace needlelab
