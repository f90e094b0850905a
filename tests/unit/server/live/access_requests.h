/// Requests for the access tests.
#pragma once

#include <string>

#include "needlelab/control.pb.h"
#include "needlelab/session.pb.h"

namespace needlelab::test {

inline pb::Login byToken(const std::string& token) {
  pb::Login login;
  login.set_token(token);
  return login;
}

inline pb::Request disable(const std::string& name) {
  pb::Request request;
  request.mutable_disable_user()->set_name(name);
  return request;
}

inline pb::Request passwordOf(const std::string& name, const std::string& password) {
  pb::Request request;
  request.mutable_set_password()->set_name(name);
  request.mutable_set_password()->set_password(password);
  return request;
}

}  // namespace needlelab::test
