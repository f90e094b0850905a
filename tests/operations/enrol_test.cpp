// A station is enrolled in two commands, and its first lesson arrives.
#include <gmock/gmock.h>

#include <fstream>

#include "client/net/link/credentials.h"
#include "common/base/files/files.h"
#include "tests/integration/lab.h"

namespace needlelab {
namespace {

using namespace test;
using namespace std::chrono_literals;
namespace fs = std::filesystem;
using testing::HasSubstr;

TEST(Bundle, survivesARoundTrip) {
  Enrolment enrolment;
  enrolment.servers = {{"lab.example.org", 7751}, {"two.example.org", 7750}};
  enrolment.station = "station 5";
  enrolment.key = std::string(31, '\x9b') + "k";
  enrolment.ca_pem = "-----BEGIN CERTIFICATE-----\nAAAA\n-----END CERTIFICATE-----\n";
  const std::string text = bundleText(enrolment);
  const auto read = parseBundle(text, "it");
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(endpointsText(read->servers), "lab.example.org:7751,two.example.org:7750");
  EXPECT_EQ(read->station, enrolment.station);
  EXPECT_EQ(read->key, enrolment.key);
  EXPECT_EQ(read->ca_pem, enrolment.ca_pem);
  // A bundle that is cut off anywhere or has a changed line is refused, and no message contains the key.
  for (std::size_t length = 0; length < text.find("-----BEGIN") + 27; length += 7) {
    const auto cut = parseBundle(std::string_view(text).substr(0, length), "it");
    ASSERT_FALSE(cut.ok()) << length;
    EXPECT_EQ(cut.error().code, ErrorCode::kInvalidInput);
    EXPECT_THAT(cut.error().message, testing::Not(HasSubstr("9b9b9b")));
  }
}

TEST(Enrol, twoCommandsMakeAStation) {
  Lab lab;
  lab.startServer();
  const int port = lab.port();
  ASSERT_EQ(lab.stopServer(), 0);
  // on the server
  const fs::path bundle = lab.path("station-7.enrol");
  ASSERT_EQ(lab.admin({"station", "enrol", "station-7", "--server-name", "127.0.0.7:" + std::to_string(port),
                       "--out", bundle}),
            0);
  EXPECT_EQ(fs::status(bundle).permissions(), fs::perms::owner_read | fs::perms::owner_write);
  lab.listen_host = "0.0.0.0";
  lab.startServer();
  // on the station
  const auto station = [&](const std::string& log, const std::vector<std::string>& arguments) {
    Process process("needlelab-station", arguments, lab.path(log));
    const auto code = process.wait();
    return std::pair(code, process.said());
  };
  const fs::path kept = lab.path("enrolled");
  const auto [enrolled, said] = station("enrol.log", {"--enrol", bundle, "--enrolled", kept});
  EXPECT_EQ(enrolled, 0) << said;
  EXPECT_THAT(said, HasSubstr("logged in to 127.0.0.7:" + std::to_string(port) + " as station-7"));
  EXPECT_EQ(fs::status(kept / "station.key").permissions(), fs::perms::owner_read | fs::perms::owner_write);
  // and its first lesson
  const auto [lesson, words] = station(
      "lesson.log", {"--enrolled", kept, "--trainee", "tom", "--exercise", "shoulder-bursa", "--device",
                     "simulated", "--headless", "--seconds", "0.5", "--spool", lab.path("spool-7")});
  EXPECT_EQ(lesson, 0) << words;
  const auto sessions = lab.sessions();
  ASSERT_EQ(sessions.size(), 1u);
  EXPECT_EQ(sessions[0].description().station(), "station-7");
  EXPECT_EQ(sessions[0].state(), pb::SESSION_COMPLETE);

  // A bundle that does not work is not stored, and the message says what to do: a name that is not in the
  // certificate …
  auto text = *readWholeFile(bundle);
  text.replace(text.find("127.0.0.7"), 9, "127.0.0.8");
  std::ofstream(lab.path("other.enrol")) << text;
  const fs::path none = lab.path("none");
  const auto [other, why] = station("other.log", {"--enrol", lab.path("other.enrol"), "--enrolled", none});
  EXPECT_EQ(other, 1);
  EXPECT_THAT(
      why, testing::AllOf(HasSubstr("not enrolled"), HasSubstr("certificate renew --host-name 127.0.0.8")));
  EXPECT_FALSE(fs::exists(none / "station.key"));
  EXPECT_FALSE(fs::exists(none / "ca.crt"));
  // … a key of another station, and no bundle at all.
  text = *readWholeFile(bundle);
  char& digit = text[text.find("key ") + 4];
  digit = digit == '0' ? '1' : '0';
  std::ofstream(lab.path("other.enrol")) << text;
  const auto [wrong, refusal] =
      station("wrong.log", {"--enrol", lab.path("other.enrol"), "--enrolled", none});
  EXPECT_EQ(wrong, 1);
  EXPECT_THAT(refusal, HasSubstr("not enrolled"));
  const auto [invalid, usage] = station("invalid.log", {"--enrol", lab.path("password"), "--enrolled", none});
  EXPECT_EQ(invalid, 2);
  EXPECT_THAT(usage, HasSubstr("needlelab-admin station enrol"));
  const auto [missing, advice] =
      station("missing.log", {"--enrolled", none, "--trainee", "tom", "--exercise", "x"});
  EXPECT_EQ(missing, 2);
  EXPECT_THAT(advice, HasSubstr("--enrol FILE"));
  EXPECT_EQ(lab.stopServer(), 0);

  // The certificate is shown, and renewed by command.
  EXPECT_EQ(lab.admin({"certificate", "show"}), 0);
  EXPECT_EQ(lab.admin({"certificate", "renew", "--host-name", "127.0.0.8"}), 0);
  EXPECT_THAT(*readWholeFile(lab.path("admin.log")),
              testing::AllOf(HasSubstr("DAYS LEFT"), HasSubstr("127.0.0.8")));
  lab.startServer();
  text = *readWholeFile(bundle);
  text.replace(text.find("127.0.0.7"), 9, "127.0.0.8");
  std::ofstream(lab.path("other.enrol")) << text;
  EXPECT_EQ(station("renewed.log", {"--enrol", lab.path("other.enrol"), "--enrolled", none}).first, 0);
}

}  // namespace
}  // namespace needlelab
