// `station enrol` with a server that changes between two of its requests.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <sstream>
#include <string>

#include "client/admin/command.h"
#include "client/net/credentials.h"
#include "common/base/files.h"
#include "tests/support/temp_folder.h"

namespace needlelab {
namespace {

using testing::HasSubstr;

/// Has one station, "lab", which its list shows as active. `revoked_meanwhile`: somebody revokes it behind
/// the list, once.
class RacingServer : public Backend {
 public:
  explicit RacingServer(bool revoked_meanwhile) : revoked_(revoked_meanwhile) {}
  Result<pb::Reply> call(const pb::Request& request) override {
    pb::Reply reply;
    if (request.has_list_stations()) {
      reply.mutable_stations()->add_stations()->set_name("lab");
      return reply;
    }
    if (!request.has_add_station()) return Error{ErrorCode::kFailed, "the test has no such request"};
    if (!revoked_) return Error{ErrorCode::kAlreadyExists, "station 'lab': revoke it first"};
    revoked_ = false;
    reply.mutable_station_key()->set_key(kKey);
    return reply;
  }
  [[nodiscard]] bool local() const override { return false; }

  const std::string kKey = std::string(31, 'k') + "\x01";

 private:
  bool revoked_;
};

class StationEnrolment : public testing::Test {
 protected:
  Status enrol(RacingServer& server, const std::string& ca) {
    CLI::App app;
    ChosenCommand chosen;
    addStationCommands(app, chosen);
    app.parse("station enrol lab --server-name lab.example.org --out " + bundle_.string());
    EXPECT_TRUE(chosen.check().ok());
    GlobalOptions global;
    global.ca = ca;
    std::ostringstream out, err;
    Output output(out, err, {});
    CommandContext context{server, output, global};
    return chosen.run(context);
  }
  test::TempFolder folder_;
  std::filesystem::path bundle_ = folder_.path() / "lab.enrol";
  std::string ca_ = folder_.write("ca.crt", "a certificate\n").string();
};

TEST_F(StationEnrolment, usesTheKeyThatItGotWhereTheStationWasRevokedMeanwhile) {
  RacingServer server(true);
  const Status done = enrol(server, ca_);
  ASSERT_TRUE(done.ok()) << done.error().message;
  const auto text = readWholeFile(bundle_);
  ASSERT_TRUE(text.ok());
  EXPECT_THAT(*text, HasSubstr("key " + hexText(server.kKey)));
  EXPECT_THAT(*text, HasSubstr("a certificate"));
}

TEST_F(StationEnrolment, saysThatSuchAKeyIsLostWhereItCannotBeWritten) {
  RacingServer server(true);
  const Status done = enrol(server, (folder_.path() / "none.crt").string());
  ASSERT_FALSE(done.ok());
  EXPECT_THAT(done.error().message, HasSubstr("none.crt"));
  EXPECT_THAT(done.error().message, HasSubstr("station 'lab' was added, but its key is lost: revoke it"));
  EXPECT_FALSE(std::filesystem::exists(bundle_));
}

TEST_F(StationEnrolment, isRefusedForAnActiveStation) {
  RacingServer server(false);
  const Status done = enrol(server, ca_);
  ASSERT_FALSE(done.ok());
  EXPECT_EQ(done.error().message, "station 'lab': revoke it first");
  EXPECT_FALSE(std::filesystem::exists(bundle_));
}

}  // namespace
}  // namespace needlelab
