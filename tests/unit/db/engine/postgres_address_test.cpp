// The messages for a failed connection, by libpq's wording.
#include "db/engine/postgres.h"

#include <gmock/gmock.h>

namespace needlelab {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

const std::string kDown =
    "connection to server at \"db-a\" (192.0.2.11), port 5432 failed: Connection refused\n"
    "\tIs the server running on that host and accepting TCP/IP connections?\n";
const std::string kWrongPassword =
    "connection to server at \"db-b\" (192.0.2.12), port 5432 failed: FATAL:  password authentication failed "
    "for "
    "user \"needlelab\"\npassword retrieved from file \"/etc/needlelab/db.pass\"\n";
const std::string kNoDatabase =
    "connection to server at \"db-b\" (192.0.2.12), port 5432 failed: FATAL:  database \"labb\" does not "
    "exist\n";

ErrorCode codeOf(const std::string& said) {
  return cannotConnect("postgresql://needlelab@db-a:5432/lab", said.c_str()).code;
}

TEST(PostgresAddress, refusalsAreDistinguishedFromOutages) {
  const std::string at = "connection to server at \"db\" (192.0.2.1), port 5432 failed: ";
  const std::pair<std::string, ErrorCode> cases[] = {
      {kDown, ErrorCode::kUnavailable},
      {kWrongPassword, ErrorCode::kDenied},
      {kNoDatabase, ErrorCode::kInvalidInput},
      {at +
           "FATAL:  no pg_hba.conf entry for host \"192.0.2.9\", user \"u\", database \"d\", no encryption\n",
       ErrorCode::kDenied},
      {at + "FATAL:  pg_hba.conf rejects connection for host \"192.0.2.9\", user \"u\", database \"d\"\n",
       ErrorCode::kDenied},
      {at + "fe_sendauth: no password supplied\n", ErrorCode::kDenied},
      {at + "FATAL:  role \"u\" is not permitted to log in\n", ErrorCode::kDenied},
      {at + "FATAL:  permission denied for database \"d\"\nDETAIL:  User does not have CONNECT privilege.\n",
       ErrorCode::kDenied},
      {at + "FATAL:  role \"u\" does not exist\n", ErrorCode::kInvalidInput},
      {"could not translate host name \"dbb\" to address: Name or service not known\n",
       ErrorCode::kInvalidInput},
      {"could not translate host name \"dbb\" to address: Temporary failure in name resolution\n",
       ErrorCode::kUnavailable},
      {"invalid sslmode value: \"very\"\n", ErrorCode::kInvalidInput},
      // conditions that end by themselves, also for a user with the right password
      {at + "FATAL:  too many connections for role \"needlelab\"\n", ErrorCode::kUnavailable},
      {at + "FATAL:  remaining connection slots are reserved\n", ErrorCode::kUnavailable},
      {at + "FATAL:  the database system is starting up\n", ErrorCode::kUnavailable},
      {at + "session is read-only\n", ErrorCode::kUnavailable},
      {at + "FATAL:  la base de données « d » n'existe pas\n", ErrorCode::kUnavailable},
      {"", ErrorCode::kUnavailable}};
  for (const auto& [said, code] : cases) EXPECT_EQ(codeOf(said), code) << said;
}

TEST(PostgresAddress, ofSeveralHostsOneThatMayComeBackCounts) {
  EXPECT_EQ(codeOf(kDown + kWrongPassword), ErrorCode::kUnavailable);
  EXPECT_EQ(codeOf(kWrongPassword + kDown), ErrorCode::kUnavailable);
  EXPECT_EQ(codeOf(kNoDatabase + kWrongPassword), ErrorCode::kDenied);
  EXPECT_EQ(codeOf(kNoDatabase + kNoDatabase), ErrorCode::kInvalidInput);
}

TEST(PostgresAddress, theMessageIsOneLineWithEachHostsReply) {
  const std::string message = cannotConnect("postgresql://u@h:1/d", (kDown + kWrongPassword).c_str()).message;
  EXPECT_THAT(message, AllOf(HasSubstr("postgresql://u@h:1/d: cannot connect: "),
                             HasSubstr("Connection refused; "), HasSubstr("password authentication failed"),
                             Not(HasSubstr("\n")), Not(HasSubstr("Is the server running"))));
  EXPECT_THAT(cannotConnect("url", kWrongPassword.c_str()).message, HasSubstr("passfile, PGPASSFILE"));
  EXPECT_THAT(cannotConnect("url", "FATAL: \x1b[2J\n").message, Not(HasSubstr("\x1b")));
}

}  // namespace
}  // namespace needlelab
