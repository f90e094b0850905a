#include "client/station/run/io/station_key.h"

#include <fmt/core.h>
#include <sys/stat.h>

#include <iostream>

#include "client/net/link/connect.h"
#include "client/net/link/credentials.h"
#include "common/base/files/files.h"
#include "common/base/program.h"
#include "common/base/secret.h"
#include "common/base/text/text.h"

namespace needlelab {
namespace {

// advice after the server refused or did not answer
std::string adviceFor(const Error& error, const Enrolment& enrolment) {
  if (error.message.find(kNotForThisName) != std::string::npos) {
    const bool one = enrolment.servers.size() == 1;
    const std::string host = one ? enrolment.servers.front().host : "its name here";
    return "; the server's certificate is not for " + host +
           ": on the server, needlelab-admin --data DIR certificate renew --host-name " +
           (one ? host : "NAME") + ", then restart it";
  }
  if (error.code == ErrorCode::kUnavailable)
    return "; see that the server runs and listens on an address that this computer reaches";
  return {};
}

}  // namespace

Result<StationKey> parseStationKey(std::string_view text, const std::string& source) {
  const auto fail = [&](const std::string& why) {
    return Error{
        ErrorCode::kInvalidInput,
        source + ": " + why +
            "; a key file is one line, NAME:64 hexadecimal digits, as needlelab-admin station add writes it"};
  };
  text = withoutMark(text);
  while (!text.empty() && (text.back() == '\n' || text.back() == '\r' || text.back() == ' '))
    text.remove_suffix(1);
  const std::size_t colon = text.rfind(':');
  if (colon == std::string_view::npos) return fail("there is no ':'");
  StationKey key;
  key.station = text.substr(0, colon);
  if (key.station.empty()) return fail("the name before the ':' is missing");
  if (key.station.size() > 100 || key.station.find('\n') != std::string::npos)
    return fail("the name before the ':' is longer than a name is");
  const std::string_view hex = text.substr(colon + 1);
  if (hex.size() != 64) return fail(fmt::format("the key has {} digits", hex.size()));
  for (std::size_t i = 0; i < hex.size(); i += 2) {
    const int high = hexDigit(hex[i]), low = hexDigit(hex[i + 1]);
    if (high < 0 || low < 0) return fail("the key has a character that is not a hexadecimal digit");
    key.key.push_back(static_cast<char>(high * 16 + low));
  }
  return key;
}

Result<StationKey> loadStationKey(const std::filesystem::path& path) {
  auto text = readWholeFile(path, 4096);
  if (!text.ok()) return text.error();
  const WipeAtEnd wiped(*text);  // in place, because a move would leave a copy
  warnWhenOthersMayRead(path);
  return parseStationKey(*text, path.string());
}

int runEnrol(const StationOptions& options) {
  const auto fail = [](const Error& error, const std::string& more = {}) {
    std::cerr << "needlelab-station: " << error.message << more << "\n";
    return exitCodeOf(error);
  };
  const auto text = readWholeFile(options.bundle, 1u << 20);
  if (!text.ok()) return fail(text.error());
  const auto enrolment = parseBundle(*text, options.bundle.string());
  if (!enrolment.ok()) return fail(enrolment.error());
  struct stat info {};
  if (::stat(options.bundle.c_str(), &info) == 0 && (info.st_mode & 077) != 0)
    std::cerr << "needlelab-station: " << options.bundle.string()
              << " holds the station's key and others may read it: chmod 600, and remove it after this\n";
  std::error_code error;
  std::filesystem::create_directories(options.enrolled, error);
  if (error)
    return fail({ErrorCode::kFailed, "cannot make " + options.enrolled.string() + ": " + error.message() +
                                         "; choose another folder with --enrolled DIR"});

  // stores the key only after a successful log-in
  const auto proven = proveEnrolment(*enrolment, options.enrolled);
  if (!proven.ok())
    return fail({proven.error().code, "not enrolled: " + proven.error().message},
                adviceFor(proven.error(), *enrolment));
  if (auto saved = saveEnrolment(*enrolment, options.enrolled); !saved.ok()) return fail(saved.error());
  std::cout << "enrolled: logged in to " << endpointText(proven->server) << " as " << proven->station
            << "; kept in " << options.enrolled.string() << ". Remove " << options.bundle.string()
            << " now, and practise with: needlelab-station --enrolled"
            << (options.enrolled == defaultEnrolmentFolder() ? "" : " " + options.enrolled.string())
            << " --trainee NAME --exercise ID\n";
  return std::cout.flush() ? kExitDone : kExitFailed;
}

}  // namespace needlelab
