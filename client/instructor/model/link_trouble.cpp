#include "client/instructor/model/link_trouble.h"

#include "client/net/connect.h"
#include "common/base/text.h"

namespace needlelab {
namespace {

bool contains(const Error& error, const std::string& part) {
  return error.message.find(part) != std::string::npos;
}

LinkTrouble denied(const Error& error, const std::string& server) {
  if (contains(error, kNotForThisName)) {
    return {
        "The server's certificate is not made for the address " + server + ".",
        "Use the name that the certificate has (ask who runs the server), or have the server started with "
        "--host-name for this address.",
        true,
        {}};
  }
  if (contains(error, "(ROLE)")) {
    return {"This account may not do that.",
            "Log in as an instructor, curriculum manager or administrator.",
            true,
            {}};
  }
  if (contains(error, "(LOGIN)")) {
    return {"The server does not accept this name and password.",
            "Check both: upper and lower case matter. If they are right, the account may be disabled or its "
            "password changed; ask an administrator.",
            true,
            {}};
  }
  return {
      "The certificate of the server at " + server + " does not belong to the chosen CA file.",
      "Choose the tls/ca.crt of this very server; a server that was set up anew has a new one. If the file "
      "is right, something else answers at this address: do not enter a password, ask who runs the lab.",
      true,
      {}};
}

LinkTrouble explanationOf(const Error& error, const std::string& server) {
  switch (error.code) {
    case ErrorCode::kDenied:
      return denied(error, server);
    case ErrorCode::kVersion:
      return {"Server and this program speak different versions.",
              "Bring the older of both up to date; both versions stand in the details.",
              true,
              {}};
    case ErrorCode::kInvalidInput:
    case ErrorCode::kNotFound:
      return {"The CA file cannot be used.",
              "Choose the file tls/ca.crt from the server's folder; who runs the server has it.",
              true,
              {}};
    case ErrorCode::kCorrupt:
      return {"What answers at " + server + " is no needlelab-server.",
              "Check host and port: the instructor's port is 7750 unless the lab says otherwise.",
              true,
              {}};
    case ErrorCode::kUnavailable:
      break;
    default:
      return {"The connection failed.", "It is tried again by itself; the details say more.", false, {}};
  }
  if (contains(error, "(RATE_LIMITED)")) {
    return {"The server asks for patience: too many log-ins failed.",
            "Wait a minute; it is tried again by itself.",
            false,
            {}};
  }
  if (contains(error, "(SHUTTING_DOWN)") || contains(error, "said bye")) {
    return {"The server at " + server + " is being shut down or restarted.",
            "Nothing to do: as soon as it is back, the connection is made again.",
            false,
            {}};
  }
  return {"No needlelab-server answers at " + server + ".",
          "Is the server running, and is this its address? It is tried again by itself.",
          false,
          {}};
}

}  // namespace

LinkTrouble troubleOf(const Error& error, const std::string& server) {
  LinkTrouble trouble = explanationOf(error, printable(server));
  trouble.detail = printable(error.message);
  return trouble;
}

}  // namespace needlelab
