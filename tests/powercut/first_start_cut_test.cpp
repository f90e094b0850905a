// Power cuts while a server creates its folder: the next start works, and a published CA stays valid.
#include <gtest/gtest.h>

#include "common/base/files/files.h"
#include "common/wire/certificates.h"
#include "db/login/credentials.h"
#include "server/base/log.h"
#include "server/server.h"
#include "tests/powercut/campaign.h"
#include "tests/powercut/watched_disk.h"

namespace needlelab::test {
namespace {

namespace fs = std::filesystem;

Result<std::unique_ptr<Server>> startOn(const fs::path& data) {
  setLogLevel(LogLevel::kOff);
  ServerOptions options;
  options.data = data;
  options.listen = "127.0.0.1:0";
  return Server::start(std::move(options));
}

std::string textOfFile(const fs::path& path) {
  auto text = readWholeFile(path);
  return text.ok() ? *text : std::string();
}

/// What the server had published before an instant.
struct Known {
  std::string ca;
  bool station = false;
};
Known knownBefore(const DiskLog& log, std::size_t instant) {
  Known known;
  for (std::size_t i = 0; i < instant; ++i) {
    if (log.events()[i].name == "listening") known.ca = log.events()[i].data;
    if (log.events()[i].name == "station") known.station = true;
  }
  return known;
}

std::string judgeStart(const DiskLog& log, const fs::path& folder, std::size_t instant) {
  const Known known = knownBefore(log, instant);
  auto server = startOn(folder / "data");
  if (!server.ok()) return server.error().message;
  const auto ca = textOfFile((*server)->caFile());
  if (!known.ca.empty() && ca != known.ca) return "the CA that was given out is another one now";
  if (ca.find("-----END CERTIFICATE-----") == std::string::npos) return "half a CA";
  // key and certificate match, and the CA signed them
  const auto again = ensureTlsFiles(tlsFilesIn(folder / "data" / "tls"), {{"127.0.0.1"}});
  if (!again.ok()) return again.error().message;
  if (*again) return "the certificate that the server started with was not good";
  auto reader = (*server)->store().readers().borrow();
  if (!reader.ok()) return reader.error().message;
  const auto station = StationStore(**reader).find("station-1");
  if (!station.ok()) return station.error().message;
  if (known.station && !station->has_value()) return "the station that was added is unknown";
  return {};
}

TEST(FirstStartCut, theNextStartWorksAndTheCaStays) {
  const std::uint64_t seed = seedOr(20261122);
  const TempFolder folder;
  DiskLog log;
  {
    const Watching watching(folder.path(), log);
    auto server = startOn(folder.path() / "data");
    ASSERT_TRUE(server.ok()) << server.error().message;
    log.mark("listening", 0, textOfFile((*server)->caFile()));
    pb::Request request;
    request.mutable_add_station()->set_name("station-1");
    ASSERT_FALSE((*server)->store().service().execute({"root", pb::ADMINISTRATOR}, request).error);
    log.mark("station");
  }
  CutCounts counts;
  cutLog(
      log, log.begin(), log.events().size(), longForm() ? 600 : 24, seed,
      [&](const fs::path& left, std::size_t instant, Random&) { return judgeStart(log, left, instant); },
      counts);
  report("first start", counts);
  EXPECT_EQ(counts.bad, 0u) << counts.first;
}

}  // namespace
}  // namespace needlelab::test
