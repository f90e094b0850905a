/// Exports, studies and erasures on a store in a fresh folder.
#pragma once

#include <algorithm>
#include <array>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "db/erasure/erasure.h"
#include "db/sessions/session_results.h"
#include "db/store/schema.h"
#include "tests/support/run_form.h"
#include "tests/unit/db/dump.h"
#include "tests/unit/db/service/test_service.h"

namespace needlelab::test {

inline std::uint64_t seedOfRecords() {
  return seedOr(std::random_device()());
}

class RecordsTest : public ServiceTest {
 protected:
  /// Gets all pages, with one request per page.
  std::vector<std::string> all(const Principal& who, Store& from,
                               const std::function<void(pb::Request&, const std::string&)>& ask) {
    std::vector<std::string> records;
    std::string page;
    do {
      pb::Request request;
      ask(request, page);
      Principal asker = who;
      if (const auto account = from.service().logins().principalOf(who.name); account && *account)
        asker.name = (*account)->name;
      const Outcome outcome = from.service().execute(asker, request);
      EXPECT_FALSE(outcome.error.has_value()) << outcome.error->message;
      if (outcome.error) return records;
      EXPECT_LT(outcome.reply.ByteSizeLong(), 1u << 20);
      records.insert(records.end(), outcome.reply.records().records().begin(),
                     outcome.reply.records().records().end());
      page = outcome.reply.records().next_page();
    } while (!page.empty());
    return records;
  }
  std::vector<std::string> exportAll(Store& from, bool secrets = false) {
    return all(admin, from, [&](pb::Request& request, const std::string& page) {
      request.mutable_export_all()->set_page(page);
      request.mutable_export_all()->set_with_passwords(secrets);
    });
  }
  std::vector<std::string> study(const std::string& name, bool remarks = false) {
    return all(researcher, *store, [&](pb::Request& request, const std::string& page) {
      request.mutable_export_study()->set_study(name);
      request.mutable_export_study()->set_with_remarks(remarks);
      request.mutable_export_study()->set_page(page);
    });
  }
  void consent(const std::string& name, bool given) {
    pb::Request request;
    request.mutable_set_consent()->set_name(name);
    request.mutable_set_consent()->set_given(given);
    get(instructor, request);
  }
  Uuid closedSession(const std::string& who, std::int64_t started, const std::string& remark) {
    const Uuid id = makeUuidV7();
    EXPECT_OK(change([&](Connection& c) -> Status {
      auto d = test::describe(id);
      d.set_trainee(who);
      d.set_started_unix_ns(started);
      if (auto opened = SessionStore(c).open(d, 1); !opened) return opened.error();
      for (std::uint64_t seq = 0; seq < 3; ++seq)
        if (auto appended = SessionStore(c).append(id, seq, test::chunkOf(seq)); !appended)
          return appended.error();
      if (auto closed = SessionStore(c).close(test::closeOf(id, 3), 2); !closed) return closed.error();
      if (auto done = ScoreStore(c).put(
              test::scoreOf(id, R"([{"measure":"elapsed_s","value":1.5,"unit":"s","words":""}])"));
          !done)
        return done;
      if (remark.empty()) return {};
      const auto added = AnnotationStore(c).add({0, id, 1, remark, "ina", 1});
      return added ? Status() : Status(added.error());
    }));
    return id;
  }
  void addNamed(const std::string& name, const std::string& full_name, pb::Role role = pb::TRAINEE) {
    ASSERT_OK(change([&](Connection& c) {
      return PeopleStore(c).add({name, role, "", false, 1, full_name});
    }));
  }
  pb::Request erase(const std::string& name, bool with_open = false) {
    pb::Request request;
    request.mutable_erase_person()->set_name(name);
    request.mutable_erase_person()->set_confirm(name);
    request.mutable_erase_person()->set_with_open_sessions(with_open);
    return request;
  }
  const Principal researcher{"rea", pb::RESEARCHER};
};

/// A random database with every kind of record: texts that need escaping, numbers with full precision, bytes.
inline void fillAtRandom(Connection& c, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const auto number = [&](std::uint64_t below) { return static_cast<std::int64_t>(random() % below); };
  const auto text = [&] {
    static const std::vector<std::string> kParts = {"a", "\"", "\\", "ö",    "\xe2\x82\xac",    ", ",
                                                    "'", "{",  " ",  "x;--", "\xf0\x9f\x92\x89"};
    std::string made = "t";
    for (std::int64_t i = number(8); i > 0; --i) made += kParts[random() % kParts.size()];
    return made + "e";
  };
  std::vector<std::string> people, refs(12);
  for (std::size_t i = 0; i < refs.size(); ++i) {
    people.push_back("p" + std::to_string(i) + text());
    ASSERT_OK(PeopleStore(c).add({people.back(), i % 5 == 0 ? pb::INSTRUCTOR : pb::TRAINEE,
                                  i % 5 == 0 ? "$hash" : "", false, number(1ull << 62), text()},
                                 &refs[i]));
    ASSERT_OK(c.run("INSERT INTO consents (person, given, unix_ns, recorded_by, note) VALUES (?,?,?,?,?)",
                    refs[i], number(2), number(1ull << 62), text(), text()));
  }
  for (int i = 0; i < 4; ++i) {
    const std::string id = "g" + std::to_string(i);
    ASSERT_OK(c.run("INSERT INTO groups VALUES (?,?,?,?,?,?)", id, text(), 1 + number(100), text(),
                    number(1ull << 62), i == 3));
    for (const auto& person : refs)
      if (i != 3 && number(2) == 0) ASSERT_OK(c.run("INSERT INTO group_members VALUES (?,?)", id, person));
    ASSERT_OK(
        c.run("INSERT INTO assignments (exercise_id, group_id, due_unix_ns, by_whom, created_unix_ns) VALUES "
              "('knee-recess',?,?,?,?)",
              id, number(1ull << 62), text(), number(1ull << 62)));
  }
  for (int i = 0; i < 8; ++i) {
    const Uuid id = makeUuidV7();
    auto d = test::describe(id);
    d.set_trainee(people[random() % people.size()]);
    d.set_rate_hz(static_cast<double>(random() % 1'000'000) / 997.0);
    d.set_started_unix_ns(number(1ull << 62));
    ASSERT_OK(SessionStore(c).open(d, number(1ull << 62)));
    // The last one stays open and is not part of any export.
    if (i == 7) break;
    ASSERT_OK(SessionStore(c).append(id, 0, test::chunkOf(0)));
    ASSERT_OK(SessionStore(c).close(test::closeOf(id, 1), number(1ull << 62)));
    ASSERT_OK(ScoreStore(c).put(
        test::scoreOf(id, R"([{"measure":")" + std::string("m") + R"(","value":0.1}])", 1)));
    ASSERT_OK(ScoreStore(c).put(test::scoreOf(id, "[]", 2)));
    // A stroke's own kind must not replace the record's kind.
    pb::SyringeEvent drawn, pressed;
    drawn.set_kind(pb::SyringeEvent::ASPIRATION);
    drawn.set_end_s(static_cast<double>(random() % 1'000'000) / 997.0);
    drawn.mutable_begin()->set_tissue(text());
    pressed.set_kind(pb::SyringeEvent::INJECTION);
    pressed.add_hazards("artery");
    ASSERT_OK(EventStore(c).put(id, std::array{drawn, pressed}));
    const auto added = AnnotationStore(c).add({0, id, random() % 1000, text(), text(), number(1ull << 62)});
    ASSERT_OK(added);
    ASSERT_OK(
        c.run("UPDATE sessions SET clock_offset_ns = ?, clock_round_trip_ns = ?, passed = ?, excused = ? "
              "WHERE id = ?",
              -number(1ull << 62), number(1ull << 40), number(2), number(2), ByteView(id)));
  }
  // a disabled person opens no session
  for (const auto& person : refs)
    if (number(2) == 0) ASSERT_OK(c.run("UPDATE people SET disabled = 1 WHERE ref = ?", person));
  // one that waits, one that was assigned
  const auto ghost = addTypedName(c, "ghost", 1), another = addTypedName(c, "another ghost", 1);
  ASSERT_OK(
      c.run("INSERT INTO unknown_trainees (session, given) VALUES ((SELECT min(number) FROM sessions), ?)",
            *ghost));
  ASSERT_OK(
      c.run("INSERT INTO unknown_trainees VALUES ((SELECT min(number) + 1 FROM sessions), ?, ?, ?, 1, 0, 0)",
            *another, text(), number(1ull << 62)));
  ASSERT_OK(c.run("INSERT INTO retention_policies VALUES ('knee-recess', 30, ?, 1.0, 365, 0, ?, 1)",
                  static_cast<double>(random() % 30'000 + 1) / 3.0, text()));
  // after the sessions: those of people with codes would wait
  for (std::size_t i = 0; i < people.size(); i += 3)
    ASSERT_OK(PeopleStore(c).setCodeHash(people[i], "$code" + text()));
  ASSERT_OK(LabSettingsStore(c).setCodesRequired(number(2) == 0));
  ASSERT_OK(c.run("INSERT INTO exercise_references VALUES ('knee-recess', 1, '[]', ?, 1)", text()));
  ASSERT_OK(c.run("INSERT INTO audit (unix_ns, who, action, subject, detail) VALUES (1,?,?,?,?)", text(),
                  text(), text(), text()));
}

}  // namespace needlelab::test
