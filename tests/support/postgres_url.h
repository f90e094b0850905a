/// The addresses of test databases in the form that a request takes.
#pragma once

#include <string>

namespace needlelab::test {

/// Of "host=HOST user=USER dbname=DATABASE", as NEEDLELAB_TEST_POSTGRES and postgresUrlOf() have it, the URL.
inline std::string urlFormOf(const std::string& address) {
  const auto value = [&](const std::string& name) {
    const auto at = address.find(name + "=") + name.size() + 1;
    return address.substr(at, address.find(' ', at) - at);
  };
  return "postgresql://" + value("user") + "@/" + value("dbname") + "?host=" + value("host");
}

}  // namespace needlelab::test
