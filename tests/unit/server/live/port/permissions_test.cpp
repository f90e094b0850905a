// Every message × role × state, and every request × role: the tables beside this file compared with the
// rules, and with a server over TLS.
#include <google/protobuf/descriptor.h>
#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <set>
#include <sstream>

#include "db/service/requests/requests.h"
#include "server/live/port/rules.h"
#include "tests/unit/server/live/raw_peer.h"

namespace needlelab {
namespace {

using namespace test;
using State = ConnectionState;

constexpr State kStates[] = {State::kConnecting, State::kGreeting, State::kLoggingIn, State::kAuthenticated,
                             State::kInSession,  State::kClosing,  State::kClosed};
const std::map<pb::Role, char> kLetters = {
    {pb::ROLE_UNSPECIFIED, 'N'}, {pb::TRAINEE, 'T'}, {pb::INSTRUCTOR, 'I'}, {pb::CURRICULUM_MANAGER, 'M'},
    {pb::ADMINISTRATOR, 'A'},    {pb::STATION, 'S'}, {pb::RESEARCHER, 'R'}};

/// message → column → cell
using Table = std::map<std::string, std::map<std::string, std::string>>;

Table readTable(const std::string& name) {
  std::ifstream in(std::string(NEEDLELAB_TEST_DIR) + "/" + name);
  Table table;
  std::vector<std::string> columns;
  for (std::string line; std::getline(in, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::vector<std::string> cells;
    std::istringstream split(line);
    for (std::string cell; std::getline(split, cell, '\t');) cells.push_back(cell);
    if (columns.empty()) {
      columns = cells;
      continue;
    }
    EXPECT_EQ(cells.size(), columns.size()) << line;
    EXPECT_FALSE(table.contains(cells[0])) << "twice: " << cells[0];
    for (std::size_t i = 1; i < std::min(cells.size(), columns.size()); ++i)
      table[cells[0]][columns[i]] = cells[i];
  }
  EXPECT_FALSE(table.empty()) << name;
  return table;
}

Verdict expectedOf(const std::string& cell, pb::Role role) {
  if (cell == "state") return Verdict::kWrongState;
  if (cell == "never") return Verdict::kNeverFromPeer;
  if (cell == "unknown") return Verdict::kUnknown;
  if (cell == "ignored") return Verdict::kIgnored;
  const char letter = kLetters.at(role);
  if (cell.find(letter) != std::string::npos) return Verdict::kAllowed;
  const char small = static_cast<char>(letter - 'A' + 'a');
  return cell.find(small) != std::string::npos ? Verdict::kIgnored : Verdict::kWrongRole;
}

/// All bodies of the protocol, each in its own envelope, and one unknown to this version.
std::map<std::string, pb::Envelope> everyMessage() {
  std::map<std::string, pb::Envelope> all;
  const auto* body = pb::Envelope::descriptor()->FindOneofByName("body");
  for (int i = 0; i < body->field_count(); ++i) {
    pb::Envelope& envelope = all[body->field(i)->name()];
    (void)envelope.GetReflection()->MutableMessage(&envelope, body->field(i));
  }
  // field 1999, an empty message: as a newer minor version might send it
  EXPECT_EQ(pb::Envelope::descriptor()->FindFieldByNumber(1999), nullptr);
  EXPECT_TRUE(all["(unknown)"].ParseFromString(std::string("\xfa\x7c\x00", 3)));
  return all;
}

TEST(Permissions, everyMessageHasARowAndEveryRowIsAMessage) {
  const Table table = readTable("permissions.tsv");
  const auto messages = everyMessage();
  for (const auto& [name, envelope] : messages)
    EXPECT_TRUE(table.contains(name)) << name << " is new: decide who may send it when";
  for (const auto& [name, row] : table) EXPECT_TRUE(messages.contains(name)) << name;
}

TEST(Permissions, theRulesMatchTheTable) {
  const Table table = readTable("permissions.tsv");
  std::map<Verdict, int> seen;
  for (const auto& [name, envelope] : everyMessage()) {
    for (const State state : kStates) {
      for (const auto& [role, letter] : kLetters) {
        const Verdict expected = expectedOf(table.at(name).at(nameOf(state)), role);
        EXPECT_EQ(checkMessage(envelope.body_case(), state, role), expected)
            << name << " in " << nameOf(state) << " from " << letter;
        ++seen[expected];
      }
    }
  }
  EXPECT_EQ(seen.size(), 6u) << "every kind of verdict occurs";
}

TEST(Permissions, rolesThatDoNotExistMayNothing) {
  for (const auto& [name, envelope] : everyMessage()) {
    for (const State state : {State::kAuthenticated, State::kInSession}) {
      for (const int role : {7, 8, 31, -1, 1000}) {
        EXPECT_NE(checkMessage(envelope.body_case(), state, static_cast<pb::Role>(role)), Verdict::kAllowed)
            << name << " from role " << role;
      }
    }
  }
}

/// The server's reaction to a message, seen from outside.
Verdict seenVerdict(RawPeer& peer, const pb::Envelope& message, bool logged_in) {
  static std::uint64_t last_id = 4711;
  const std::uint64_t id = ++last_id;
  peer.send(message);
  if (logged_in) {
    pb::Envelope ping;
    ping.mutable_ping()->set_id(id);
    peer.send(ping);
  }
  Verdict verdict = Verdict::kIgnored;
  for (;;) {
    // Before log-in a Ping cannot show that there was no answer. Only a Refusal has no answer then.
    const bool quiet = !logged_in && message.has_refusal();
    const auto got = peer.receive(milliseconds(quiet ? 300 : 60'000));
    if (!got) return verdict;  // closed
    if (got->has_pong() && got->pong().id() == id) return verdict;
    // A request is processed in parallel with later messages, so its answer tells nothing about them.
    if (got->has_reply() && !message.has_request()) continue;
    if (!got->has_refusal()) {
      verdict = Verdict::kAllowed;
      if (!logged_in) return verdict;
      continue;
    }
    const pb::Refusal& refusal = got->refusal();
    const bool by_rule = refusal.text().find("(state ") != std::string::npos;
    if (refusal.reason() == pb::Refusal::STATE && by_rule)
      verdict = refusal.text().find("servers only") != std::string::npos ? Verdict::kNeverFromPeer
                                                                         : Verdict::kWrongState;
    else if (refusal.reason() == pb::Refusal::ROLE && by_rule)
      verdict = Verdict::kWrongRole;
    else if (refusal.text().find("a message without a body") != std::string::npos)
      verdict = Verdict::kUnknown;
    else
      verdict = Verdict::kAllowed;  // the handler refuses its content
    if (refusal.fatal() || !logged_in) return verdict;
  }
}

/// An allowed message without an answer has no visible effect.
void expectSeen(RawPeer& peer, const std::string& name, const pb::Envelope& message, Verdict expected,
                const std::string& where, bool logged_in) {
  const Verdict seen = seenVerdict(peer, message, logged_in);
  const bool quiet = expected == Verdict::kAllowed && seen == Verdict::kIgnored;
  EXPECT_TRUE(seen == expected || quiet) << name << " " << where << ": expected "
                                         << static_cast<int>(expected) << ", seen " << static_cast<int>(seen);
}

class PermissionsOverTls : public testing::Test {
 protected:
  static constexpr const char* kPassword = "correct horse battery";

  PermissionsOverTls() {
    key_ = server_.addStation("bench-1");
    for (const auto& [role, letter] : kLetters)
      if (role != pb::ROLE_UNSPECIFIED && role != pb::STATION)
        server_.addUser(std::string("user ") + letter, role, kPassword);
  }
  pb::Login loginOf(pb::Role role) {
    if (role == pb::STATION) return stationLogin("bench-1", key_);
    return personLogin(std::string("user ") + kLetters.at(role), kPassword);
  }
  std::unique_ptr<RawPeer> loggedIn(pb::Role role) {
    auto peer = std::make_unique<RawPeer>(server_);
    const auto answer = peer->logIn(loginOf(role));
    EXPECT_TRUE(answer.has_welcome() && answer.welcome().role() == role) << answer.DebugString();
    return peer;
  }

  RunningServer server_;
  std::string key_;
  const Table table_ = readTable("permissions.tsv");
  const std::map<std::string, pb::Envelope> messages_ = everyMessage();
};

TEST_F(PermissionsOverTls, beforeLogIn) {
  for (const auto& [name, message] : messages_) {
    const auto& row = table_.at(name);
    {
      RawPeer greeting(server_);
      pb::Envelope hello = message;
      if (hello.has_hello()) *hello.mutable_hello()->mutable_version() = ourVersion();
      expectSeen(greeting, name, hello, expectedOf(row.at("greeting"), pb::ROLE_UNSPECIFIED), "greeting",
                 false);
    }
    RawPeer logging_in(server_);
    logging_in.greet();
    expectSeen(logging_in, name, message, expectedOf(row.at("logging_in"), pb::ROLE_UNSPECIFIED),
               "logging in", false);
  }
}

TEST_F(PermissionsOverTls, loggedInByEveryRole) {
  for (const auto& [role, letter] : kLetters) {
    if (role == pb::ROLE_UNSPECIFIED) continue;
    auto peer = loggedIn(role);
    for (const auto& [name, message] : messages_) {
      if (name == "bye") continue;
      expectSeen(*peer, name, message, expectedOf(table_.at(name).at("authenticated"), role),
                 std::string("authenticated from ") + letter, true);
    }
    peer->send(messages_.at("bye"));
    EXPECT_TRUE(peer->readAll().empty() && peer->closed()) << "bye from " << letter;
  }
}

TEST_F(PermissionsOverTls, aStationInASession) {
  auto peer = loggedIn(pb::STATION);
  peer->send(FakeSession("bench-1").open());
  for (;;) {
    const auto got = peer->receive();
    ASSERT_TRUE(got.has_value());
    if (got->has_session_opened()) break;
  }
  for (const auto& [name, message] : messages_) {
    if (name == "bye") continue;
    expectSeen(*peer, name, message, expectedOf(table_.at(name).at("in_session"), pb::STATION), "in session",
               true);
  }
}

TEST_F(PermissionsOverTls, whatComesAfterTheLastWordIsIgnored) {
  for (const auto& [name, message] : messages_) {
    RawPeer peer(server_);
    // A Ping is not legal yet: refused for good. The same write contains the next message.
    peer.write(RawPeer::framed(messages_.at("ping")) + RawPeer::framed(message));
    const auto all = peer.readAll();
    ASSERT_EQ(all.size(), 1u) << name;
    EXPECT_TRUE(all[0].has_refusal() && all[0].refusal().fatal()) << name;
    EXPECT_TRUE(peer.closed()) << name;
  }
}

// --- requests

std::map<std::string, pb::Request> everyCall() {
  std::map<std::string, pb::Request> all;
  const auto* calls = pb::Request::descriptor()->FindOneofByName("call");
  for (int i = 0; i < calls->field_count(); ++i) {
    pb::Request& request = all[calls->field(i)->name()];
    (void)request.GetReflection()->MutableMessage(&request, calls->field(i));
  }
  return all;
}

TEST(PermissionsOfRequests, theRolesTableMatchesTheRequests) {
  const Table table = readTable("permissions_requests.tsv");
  const auto calls = everyCall();
  for (const auto& [name, row] : table) EXPECT_TRUE(calls.contains(name)) << name;
  for (const auto& [name, request] : calls) {
    ASSERT_TRUE(table.contains(name)) << name << " is new: decide who may ask for it";
    for (int role = -1; role <= 8; ++role) {
      const auto known = kLetters.find(static_cast<pb::Role>(role));
      const bool allowed = known != kLetters.end() && role != pb::ROLE_UNSPECIFIED &&
                           table.at(name).at("roles").find(known->second) != std::string::npos;
      EXPECT_EQ(checkRole({"x", static_cast<pb::Role>(role)}, request.call_case()).ok(), allowed)
          << name << " from role " << role;
    }
  }
}

TEST_F(PermissionsOverTls, requestsByEveryRole) {
  const Table table = readTable("permissions_requests.tsv");
  for (const auto& [role, letter] : kLetters) {
    if (role == pb::ROLE_UNSPECIFIED) continue;
    auto peer = loggedIn(role);
    std::uint64_t id = 0;
    for (const auto& [name, request] : everyCall()) {
      pb::Envelope envelope;
      *envelope.mutable_request() = request;
      envelope.mutable_request()->set_id(++id);
      peer->send(envelope);
      for (;;) {
        const auto got = peer->receive(milliseconds(60'000));
        ASSERT_TRUE(got.has_value()) << name;
        const bool refused = got->has_refusal() && got->refused_request() == id;
        if (!refused && !(got->has_reply() && got->reply().id() == id)) continue;
        // refused because of its role, not because of its content
        const bool by_role = refused && got->refusal().reason() == pb::Refusal::ROLE &&
                             got->refusal().text().find("is not for the role") != std::string::npos;
        const bool allowed = table.at(name).at("roles").find(letter) != std::string::npos;
        EXPECT_EQ(by_role, !allowed) << name << " from " << letter << ": " << got->ShortDebugString();
        break;
      }
    }
  }
}

}  // namespace
}  // namespace needlelab
