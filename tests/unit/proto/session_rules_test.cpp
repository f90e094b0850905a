#include "proto/session_rules.h"

#include <cmath>
#include <functional>
#include <limits>

#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

TEST(SessionRules, aGoodDescriptionIsAccepted) {
  auto d = test::describe(makeUuidV7());
  EXPECT_OK(checkDescription(d));
  d.set_rate_hz(40'000);  // a station's fastest loop
  EXPECT_OK(checkDescription(d));
  d.set_stiffness_share(0.55);
  EXPECT_OK(checkDescription(d));
  d.clear_exercise_id();  // free practice
  EXPECT_OK(checkDescription(d));
}

TEST(SessionRules, everyBadFieldIsNamed) {
  struct Case {
    std::string field;
    std::function<void(pb::SessionDescription&)> spoil;
  };
  const Case cases[] = {
      {"session_id", [](auto& d) { d.set_session_id("123"); }},
      {"station", [](auto& d) { d.clear_station(); }},
      {"station", [](auto& d) { d.set_station(std::string(65, 'x')); }},
      {"trainee", [](auto& d) { d.set_trainee(""); }},
      {"trainee", [](auto& d) { d.set_trainee("a\nb"); }},
      {"trainee", [](auto& d) { d.set_trainee(" anna"); }},
      {"exercise_id", [](auto& d) { d.set_exercise_id(std::string(65, 'x')); }},
      {"profile_id", [](auto& d) { d.set_profile_id(""); }},
      {"profile_json", [](auto& d) { d.set_profile_json(""); }},
      {"profile_json", [](auto& d) { d.set_profile_json(std::string(900'001, ' ')); }},
      {"engine_version", [](auto& d) { d.set_engine_version(std::string(101, '1')); }},
      {"device", [](auto& d) { d.set_device(std::string(201, 'x')); }},
      {"rate_hz", [](auto& d) { d.set_rate_hz(0); }},
      {"rate_hz", [](auto& d) { d.set_rate_hz(std::nan("")); }},
      {"rate_hz", [](auto& d) { d.set_rate_hz(1e6); }},
      {"rate_hz", [](auto& d) { d.set_rate_hz(40'001); }},
      {"started_unix_ns", [](auto& d) { d.set_started_unix_ns(-1); }},
      {"placement", [](auto& d) { d.add_placement(1); }},
      {"placement",
       [](auto& d) {
         for (int i = 0; i < 7; ++i) d.add_placement(0);
       }},
      {"tool",
       [](auto& d) {
         for (int i = 0; i < 7; ++i) d.add_tool(std::numeric_limits<double>::infinity());
       }},
      {"resolution.length_m", [](auto& d) { d.mutable_resolution()->set_length_m(-1); }},
      {"stiffness_share", [](auto& d) { d.set_stiffness_share(0); }},
      {"stiffness_share", [](auto& d) { d.set_stiffness_share(1.01); }},
      {"delay_stiffness_share", [](auto& d) { d.set_delay_stiffness_share(1.01); }},
      {"stiffness_share", [](auto& d) { d.set_stiffness_share(std::nan("")); }},
      {"resolution.time_s", [](auto& d) { d.mutable_resolution()->set_time_s(std::nan("")); }},
  };
  for (const Case& c : cases) {
    auto d = test::describe(makeUuidV7());
    c.spoil(d);
    const auto refused = checkDescription(d);
    ASSERT_FALSE(refused.ok()) << c.field;
    EXPECT_EQ(refused.error().code, ErrorCode::kInvalidInput);
    EXPECT_NE(refused.error().message.find(c.field), std::string::npos) << refused.error().message;
  }
}

TEST(WipeSecrets, emptiesPasswordsAndCodesAndLeavesTheRest) {
  pb::Request request;
  request.mutable_get_lesson()->set_trainee("tom");
  request.mutable_get_lesson()->set_code("4711");
  wipeSecrets(request);
  EXPECT_EQ(request.get_lesson().code(), "");
  EXPECT_EQ(request.get_lesson().trainee(), "tom");
  request.mutable_check_trainee()->set_code("4711");
  wipeSecrets(request);
  EXPECT_EQ(request.check_trainee().code(), "");
  request.mutable_set_password()->set_password("correct horse");
  wipeSecrets(request);
  EXPECT_EQ(request.set_password().password(), "");
  request.mutable_get_user()->set_name("tom");
  wipeSecrets(request);
  EXPECT_EQ(request.get_user().name(), "tom");
}

}  // namespace
}  // namespace needlelab
