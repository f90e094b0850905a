// Errors in a profile that are refused, and warnings to its author.
//
// Every profile error we could think of, with its message.
#include <gmock/gmock.h>

#include "common/profile/profile.h"
#include "common/profile/scene_of_profile.h"
#include "common/profile/warnings.h"
#include "tests/unit/common/profile/good_profile.h"

namespace needlelab {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

struct WrongField {
  const char* pointer;   // into the good profile
  const char* value;     // JSON value to insert; "" erases
  const char* expected;  // part of the message
};

// clang-format off
const WrongField kWrongProfiles[] = {
    // missing
    {"/id", "", "id: is missing"},
    {"/name", "", "name: is missing"},
    {"/needle", "", "needle: is missing"},
    {"/needle/length_m", "", "needle.length_m: is missing"},
    {"/limb", "", "limb: is missing"},
    {"/layers", "", "layers: is missing: give 1 to 32, from the skin inwards"},
    {"/tracking_wall", "", "tracking_wall: is missing"},
    {"/effects", "", "effects: is missing"},
    {"/layers/1/tissue", "", "layers[1].tissue: is missing"},
    {"/layers/1/thickness_m", "", "layers[1].thickness_m: is missing"},
    {"/layers/0/puncture/force_n", "", "layers[0].puncture.force_n: is missing"},
    {"/tracking_wall/stop_dwell_s", "", "tracking_wall.stop_dwell_s: is missing"},
    {"/limb/plane/normal", "", "limb.plane.normal: is missing"},
    {"/limb/plane/normal/z", "", "limb.plane.normal.z: is missing"},
    {"/targets/0/radius_m", "", "targets[0].radius_m: is missing"},
    {"/hazards/0/kind", "", "hazards[0].kind: is missing"},
    {"/virtual_fixture", "", "virtual_fixture: is missing, and effects lists CLAMPING"},
    {"/orientation_limit", "", "orientation_limit: is missing, and effects lists ORIENTATION_LIMIT"},
    {"/shaft_friction", "", "shaft_friction: is missing, and effects lists SHAFT_FRICTION"},
    {"/effects", "[\"CUT_MEMORY\"]", "cut_memory: is missing, and effects lists CUT_MEMORY"},
    {"/cut_memory", "{\"cutting_share\": 0.3}", "cut_memory.radius_m: is missing"},
    {"/effects", "[\"BONE\"]", "bone: is missing, and effects lists BONE"},
    {"/bone", "{\"stiffness_n_per_m\": 600}", "bone.friction_coefficient: is missing"},
    {"/bone", "{\"stiffness_n_per_m\": 600, \"friction_coefficient\": 0.3, \"normal\": {\"x\": 1, \"y\": 0}}", "bone.normal.z: is missing"},
    {"/tracking_wall/relax_time_s", "", "tracking_wall.relax_time_s: is missing, and stop_mode is EXPONENTIAL"},
    {"/tracking_wall/relax_residual", "", "tracking_wall.relax_residual: is missing, and stop_mode is EXPONENTIAL"},
    // unknown fields
    {"/colour", "\"red\"", "unknown field \"colour\"; known are id, name"},
    {"/layers/0/thickness_mm", "3", "layers[0]: unknown field \"thickness_mm\"; known are tissue, name, thickness_m"},
    {"/layers/0/puncture/depth_m", "3", "layers[0].puncture: unknown field \"depth_m\""},
    {"/limb/box", "{}", "limb: unknown field \"box\"; known are plane, sphere, capsule"},
    {"/limb/plane/point_m/w", "0", "limb.plane.point_m: unknown field \"w\"; known are x, y, z"},
    {"/", "1", "unknown field \"\""},
    // wrong types
    {"/id", "7", "id: must be a text, found the number 7"},
    {"/name", "null", "name: must be a text, found null"},
    {"/needle", "0.06", "needle: must be an object, found the number 0.06"},
    {"/needle", "[]", "needle: must be an object, found a list"},
    {"/needle/length_m", "\"0.06\"", "needle.length_m: must be a number, found the text \"0.06\""},
    {"/needle/length_m", "true", "needle.length_m: must be a number, found true"},
    {"/needle/length_m", "null", "needle.length_m: must be a number, found null"},
    {"/needle/length_m", "[0.06]", "needle.length_m: must be a number, found a list"},
    {"/layers", "{}", "layers: must be a list, found an object"},
    {"/layers/0", "3", "layers[0]: must be an object, found the number 3"},
    {"/layers/0/tissue", "1", "layers[0].tissue: must be one of SKIN, FAT, MUSCLE, BURSA, CAPSULE, TENDON, CARTILAGE, BONE, OTHER; found the number 1"},
    {"/effects", "\"CUTTING\"", "effects: must be a list, found the text \"CUTTING\""},
    {"/effects/0", "1", "effects[0]: must be one of CUTTING, ATTRACTED"},
    {"/hazards/0/center_m", "[0, 0, 0]", "hazards[0].center_m: must be an object, found a list"},
    // values that are not numbers
    {"/layers/0/cutting_force_n", "\"NaN\"", "layers[0].cutting_force_n: must be a number, found the text \"NaN\""},
    {"/layers/0/cutting_force_n", "\"Infinity\"", "layers[0].cutting_force_n: must be a number, found the text \"Infinity\""},
    {"/limb/plane/point_m/x", "\"-Infinity\"", "limb.plane.point_m.x: must be a number, found the text \"-Infinity\""},
    // out of range
    {"/needle/length_m", "0", "needle.length_m: 0 is out of range (0, 1]"},
    {"/needle/length_m", "-0.06", "needle.length_m: -0.06 is out of range (0, 1]"},
    {"/needle/length_m", "1.0001", "needle.length_m: 1.0001 is out of range (0, 1]"},
    {"/layers/1/cutting_force_n", "75", "layers[1].cutting_force_n: 75 is out of range [0, 50]"},
    {"/tracking_wall/stiffness_n_per_m", "0", "tracking_wall.stiffness_n_per_m: 0 is out of range (0, 10000]"},
    {"/targets/0/radius_m", "-1", "targets[0].radius_m: -1 is out of range (0, 1]"},
    {"/targets/0/center_m/x", "1e300", "targets[0].center_m.x: 1e+300 is out of range [-1000, 1000]"},
    {"/hazards/1/radius_m", "0", "hazards[1].radius_m: 0 is out of range (0, 1]"},
    // names
    {"/layers/0/tissue", "\"SKINN\"", "layers[0].tissue: \"SKINN\" is not one of SKIN, FAT, MUSCLE, BURSA, CAPSULE"},
    {"/layers/0/tissue", "\"skin\"", "layers[0].tissue: \"skin\" is not one of SKIN"},
    {"/layers/0/tissue", "\"TISSUE_UNSPECIFIED\"", "layers[0].tissue: \"TISSUE_UNSPECIFIED\" is not one of SKIN"},
    {"/hazards/0/kind", "\"MUSCLE\"", "hazards[0].kind: \"MUSCLE\" is not one of BONE, NERVE, VESSEL, OTHER"},
    {"/axial_model", "\"MAGIC\"", "axial_model: \"MAGIC\" is not one of ENHANCED_TRACKING_WALL"},
    {"/tracking_wall/stop_mode", "\"LINEAR\"", "tracking_wall.stop_mode: \"LINEAR\" is not one of RAMP, EXPONENTIAL"},
    {"/virtual_fixture/mode", "\"ACTIVE\"", "virtual_fixture.mode: \"ACTIVE\" is not one of PROPORTIONAL, CONSERVATIVE"},
    {"/effects/2", "\"GRAVITY\"", "effects[2]: \"GRAVITY\" is not one of CUTTING, ATTRACTED, CLAMPING"},
    {"/effects/1", "\"CUTTING\"", "effects[1]: CUTTING is listed twice"},
    {"/id", "\"\"", "id: has 0 bytes, allowed are 1 to 64"},
    {"/id", "\"0123456789012345678901234567890123456789012345678901234567890123456789\"", "id: has 70 bytes, allowed are 1 to 64"},
    {"/id", "\"../etc\"", "id: \"../etc\" may hold letters, digits"},
    {"/id", "\"a b\"", "id: \"a b\" may hold letters, digits"},
    {"/name", "\"two\\nlines\"", "name: has control characters"},
    {"/name", "\"bell\\u0007\"", "name: has control characters"},
    {"/description", "\"escape \\u001b[2J\"", "description: has control characters"},
    {"/targets/0/name", "\"\"", "targets[0].name: has 0 bytes"},
    {"/layers/1/name", "\"\"", "layers[1].name: has 0 bytes, allowed are 1 to 64"},
    {"/layers/1/name", "\"01234567890123456789012345678901234567890123456789012345678901234\"", "layers[1].name: has 65 bytes, allowed are 1 to 64"},
    {"/layers/1/name", "null", "layers[1].name: must be a text, found null"},
    {"/layers/1/name", "\"two\\nlines\"", "layers[1].name: has control characters"},
    {"/layers/1/name", "\"\\u009b2J\"", "layers[1].name: holds a control character"},
    {"/layers/1/name", "\" dura\"", "layers[1].name: begins or ends with a space"},
    {"/layers/1/name", "\" \"", "layers[1].name: begins or ends with a space"},
    {"/hazards/1/name", "\"humeral head\"", "hazards[1].name: \"humeral head\" is used twice"},
    {"/targets/1", R"({"name": "joint space", "center_m": {"x": 0, "y": 0, "z": 0}, "radius_m": 0.1})",
     "targets[1].name: \"joint space\" is used twice"},
    {"/targets/0/tissues", "[\"muscle\", \"bursa\"]",
     "targets[0].tissues[1]: \"bursa\" is not the name of a layer: skin, muscle"},
    {"/targets/0/anchor", R"({"layer": "fat", "offset_m": 0.01})",
     "targets[0].anchor.layer: \"fat\" is not the name of a layer: skin, muscle"},
    {"/targets/0/anchor", R"({"layer": "skin"})", "targets[0].anchor.offset_m: is missing"},
    {"/directions", R"({"plus_x": ""})", "directions.plus_x: has 0 bytes, allowed are 1 to 64"},
    {"/directions", R"({"minus_y": " down the arm"})", "directions.minus_y: begins or ends with a space"},
    {"/directions", R"({"up": "towards the head"})", "directions: unknown field \"up\"; known are plus_x, minus_x"},
    // how many
    {"/layers", "[]", "layers: is missing: give 1 to 32, from the skin inwards"},
    {"/effects", "[\"CUTTING\", \"CUTTING\", \"CUTTING\", \"CUTTING\", \"CUTTING\", \"CUTTING\", \"CUTTING\", \"CUTTING\", \"CUTTING\", \"CUTTING\", \"CUTTING\", \"CUTTING\", \"CUTTING\", \"CUTTING\", \"CUTTING\", \"CUTTING\", \"CUTTING\", \"CUTTING\", \"CUTTING\", \"CUTTING\"]", "effects: has 20 items, allowed are 0 to "},
    // shapes
    {"/limb", "{}", "limb: give exactly one of plane, sphere, capsule; found none"},
    {"/limb/sphere", R"({"center_m": {"x": 0, "y": 0, "z": 0}, "radius_m": 0.05})",
     "limb: give exactly one of plane, sphere, capsule; found plane, sphere"},
    {"/limb/plane/normal/z", "0", "limb.plane.normal: is not a direction"},
    {"/limb", R"({"capsule": {"a_m": {"x": 1, "y": 2, "z": 3}, "b_m": {"x": 1, "y": 2, "z": 3}, "radius_m": 0.05}})",
     "limb.capsule.b_m: is the same point as a_m"},
    {"/limb", R"({"sphere": {"center_m": {"x": 0, "y": 0, "z": 0}, "radius_m": 0}})",
     "limb.sphere.radius_m: 0 is out of range (0, 1]"},
    {"/hazards/0/center_m", "", "hazards[0]: give either center_m or a segment a_m, b_m; found neither"},
    {"/hazards/1/center_m", R"({"x": 0, "y": 0, "z": 0})",
     "hazards[1]: give either center_m or a segment a_m, b_m; found both"},
    {"/hazards/1/b_m", "", "hazards[1]: a segment needs a_m and b_m; b_m is missing"},
    {"/hazards/1/a_m", "", "hazards[1]: a segment needs a_m and b_m; a_m is missing"},
    {"/hazards/1/b_m/y", "-0.03", "hazards[1].b_m: is the same point as a_m"},
    // forces that do not go together
    {"/layers/0/rejection_force_n", "0.45", "layers[0].rejection_force_n: 0.45 is above 0.4, the least of cutting_force_n and"},
    {"/layers/0/attracted_force_n", "0", "layers[0].rejection_force_n: 0.1 is above 0,"},
    {"/layers/0/cutting_force_n", "0.05", "layers[0].rejection_force_n: 0.1 is above 0.05"},
    {"/layers/0/puncture", R"({"linear_n_per_m": 0, "quadratic_n_per_m2": 0, "force_n": 1})",
     "layers[0].puncture: linear_n_per_m and quadratic_n_per_m2 are both 0"},
};

// texts that fail before they are parsed as a profile, or in ways that a JSON tree cannot represent
const std::pair<std::string, const char*> kWrongTexts[] = {
    {"", "not valid JSON"},
    {"   ", "not valid JSON"},
    {"[]", "must be an object, found a list"},
    {"null", "must be an object, found null"},
    {"7", "must be an object, found the number 7"},
    {"\"text\"", "must be an object, found the text \"text\""},
    {"{} {}", "not valid JSON"},
    {"{\"id\": \"a\",}", "not valid JSON"},
    {"{'id': 'a'}", "not valid JSON"},
    {"{\"id\": \"a\" // comment\n}", "not valid JSON"},
    {kGoodProfile.substr(0, kGoodProfile.size() / 2), "not valid JSON"},
    {"{\"id\": \"a\", \"id\": \"b\"}", "id: is given twice"},
    {"{\"needle\": {\"length_m\": 0.1, \"length_m\": 0.2}}", "needle.length_m: is given twice"},
    {"{\"needle\": {\"length_m\": 0.1, \"lengthM\": 0.2}}", "needle.length_m: is given twice, as length_m and as lengthM"},
    {"{\"layers\": [{}, {\"thickness_m\": 1e999}]}", "layers[1].thickness_m: 1e999 is too large for a number"},
    {"{\"needle\": {\"length_m\": -1e999}}", "needle.length_m: -1e999 is too large for a number"},
    {"{\"needle\": {\"length_m\": NaN}}", "needle.length_m: not valid JSON"},
    {"{\"needle\": {\"length_m\": Infinity}}", "needle.length_m: not valid JSON"},
    {"{\"needle\": {\"length_m\": 0x10}}", "needle.length_m: not valid JSON"},
    {"{\"needle\": {\"length_m\": .5}}", "needle.length_m: not valid JSON"},
    {"{\"needle\": {\"length_m\": +5}}", "needle.length_m: not valid JSON"},
    {"{\"id\": \"\xff\xfe\"}", "id: not valid JSON"},
    {"{\"layers\": [{\"name\": \"\xff\xfe\"}]}", "layers[0].name: not valid JSON"},
    {std::string("{\"id\": \"a\0b\"}", 13), "id: not valid JSON"},
    {"{\"id\": \"a\\u0000b\"}", "id: has control characters"},
    {std::string(100, '['), "is nested deeper than 32"},
    {std::string(200'000, '['), "is nested deeper than 32"},
    {"{\"id\": \"" + std::string(1 << 20, 'a') + "\"}", "bytes are too many, at most 1048576 are read"},
};
// clang-format on

TEST(ProfileRules, theUnchangedProfileIsRight) {
  const auto profile = parseProfile(kGoodProfile, "good.json");
  ASSERT_TRUE(profile.ok()) << profile.error().message;
}

TEST(ProfileRules, eachWrongProfileIsRefusedWithFileFieldAndRange) {
  EXPECT_GE(std::size(kWrongProfiles) + std::size(kWrongTexts), 80u);
  for (const WrongField& wrong : kWrongProfiles) {
    SCOPED_TRACE(std::string(wrong.pointer) + " = " + wrong.value);
    const auto profile = parseProfile(mutated(kGoodProfile, wrong.pointer, wrong.value), "dir/p.json");
    ASSERT_FALSE(profile.ok());
    EXPECT_EQ(profile.error().code, ErrorCode::kInvalidInput);
    EXPECT_THAT(profile.error().message, StartsWith(std::string("dir/p.json: ")));
    EXPECT_THAT(profile.error().message, HasSubstr(wrong.expected));
  }
}

TEST(ProfileRules, brokenTextsAreRefusedByPlace) {
  for (const auto& [text, expected] : kWrongTexts) {
    SCOPED_TRACE(text.substr(0, 80));
    const auto profile = parseProfile(text, "p.json");
    ASSERT_FALSE(profile.ok());
    EXPECT_EQ(profile.error().code, ErrorCode::kInvalidInput);
    EXPECT_THAT(profile.error().message, StartsWith("p.json: "));
    EXPECT_THAT(profile.error().message, HasSubstr(expected));
    EXPECT_LT(profile.error().message.size(), 1000u) << "a message is for a person";
  }
}

TEST(ProfileRules, tooManyLayersAreRefusedBeforeTheyAreRead) {
  nlohmann::json tree = nlohmann::json::parse(kGoodProfile);
  const auto layer = tree["layers"][1];
  while (tree["layers"].size() < 32) tree["layers"].push_back(layer);
  EXPECT_TRUE(parseProfile(tree.dump(), "p").ok());
  tree["layers"].push_back(7);  // the thirty-third: the message must not report its own error
  const auto profile = parseProfile(tree.dump(), "p");
  ASSERT_FALSE(profile.ok());
  EXPECT_THAT(profile.error().message, HasSubstr("layers: has 33 items, allowed are 0 to 32"));
}

TEST(ProfileRules, manyTargetsAndHazardsAreRefused) {
  for (const auto& [list, most] : {std::pair{"targets", 32}, std::pair{"hazards", 64}}) {
    nlohmann::json tree = nlohmann::json::parse(kGoodProfile);
    nlohmann::json item = tree[list][0];
    tree[list] = nlohmann::json::array();
    for (int i = 0; i <= most; ++i) {
      item["name"] = "n" + std::to_string(i);
      tree[list].push_back(item);
    }
    const auto profile = parseProfile(tree.dump(), "p");
    ASSERT_FALSE(profile.ok());
    EXPECT_THAT(profile.error().message,
                HasSubstr(std::string(list) + ": has " + std::to_string(most + 1) + " items"));
    tree[list].erase(0);
    EXPECT_TRUE(parseProfile(tree.dump(), "p").ok());
  }
}

const WrongField kWrongCurricula[] = {
    {"/id", "", "id: is missing"},
    {"/exercises", "[]", "exercises: has 0 items, allowed are 1 to 1000"},
    {"/exercises/1/id", "\"one\"", "exercises[1].id: \"one\" is used twice"},
    {"/exercises/1/id", "\"a/b\"", "exercises[1].id: \"a/b\" may hold letters"},
    {"/exercises/0/profile_id", "", "exercises[0].profile_id: is missing"},
    {"/exercises/0/profile_id", "\"a b\"", "exercises[0].profile_id: \"a b\" may hold letters"},
    {"/exercises/0/time_limit_s", "0", "exercises[0].time_limit_s: 0 is out of range (0, 86400]"},
    {"/exercises/0/requirements/0/max", "", "exercises[0].requirements[0]: says nothing about peak_force_n"},
    {"/exercises/0/requirements/1/min", "2", "exercises[0].requirements[1].min: 2 is above max, 1"},
    {"/exercises/0/requirements/0/measure", "", "exercises[0].requirements[0].measure: is missing"},
    {"/exercises/0/requirements/0/max", "\"5\"", "exercises[0].requirements[0].max: must be a number"},
    {"/results_from_unix_ms", "5", "results_from_unix_ms: is for an exam, and exam is not true"},
    {"/results_from_unix_ms", "-1", "results_from_unix_ms: -1 is out of range [0, 9"},
    {"/exam", "1", "exam: must be true or false, found the number 1"},
    {"/assigned_only", "\"yes\"", "assigned_only: must be true or false, found the text"},
    {"/exercises/0/due_unix_ms", "0.5", "exercises[0].due_unix_ms: must be a whole number of milliseconds"},
    {"/exercises/0/repeat", "3", "exercises[0]: unknown field \"repeat\""},
};

TEST(WrongCurricula, eachIsRefusedWithFileFieldAndReason) {
  ASSERT_TRUE(parseCurriculum(kGoodCurriculum, "c.json").ok());
  for (const WrongField& wrong : kWrongCurricula) {
    SCOPED_TRACE(std::string(wrong.pointer) + " = " + wrong.value);
    const auto curriculum = parseCurriculum(mutated(kGoodCurriculum, wrong.pointer, wrong.value), "c.json");
    ASSERT_FALSE(curriculum.ok());
    EXPECT_EQ(curriculum.error().code, ErrorCode::kInvalidInput);
    EXPECT_THAT(curriculum.error().message, StartsWith(std::string("c.json: ") + wrong.expected));
  }
}

// ---- the needle's section of a profile ----

using ::testing::HasSubstr;
using ::testing::IsEmpty;

Result<pb::Profile> withNeedle(const std::string& needle) {
  auto tree = nlohmann::json::parse(kGoodProfile);
  tree["needle"] = nlohmann::json::parse(needle);
  return parseProfile(tree.dump(), "p.json");
}

TEST(NeedleSection, isReadAsWritten) {
  const auto profile =
      withNeedle(R"({"length_m": 0.09, "gauge": 18, "outer_diameter_m": 0.00127, "tip": "TUOHY",
                     "bevel_angle_rad": 0.4})");
  ASSERT_TRUE(profile.ok()) << profile.error().message;
  const NeedleSpec needle = needleOf(profile->needle());
  EXPECT_EQ(needle.length_m, 0.09);
  EXPECT_EQ(needle.outer_diameter_m, 0.00127) << "the measured one counts";
  EXPECT_EQ(needle.tip, NeedleTip::kTuohy);
  EXPECT_EQ(needle.bevel_angle_rad, 0.4);
  EXPECT_THAT(profileJson(*profile), HasSubstr("\"needle\": {\"length_m\": 0.09, \"gauge\": 18, "
                                               "\"outer_diameter_m\": 0.00127, \"tip\": \"TUOHY\", "
                                               "\"bevel_angle_rad\": 0.4}"));
  const auto again = parseProfile(profileJson(*profile), "again");
  ASSERT_TRUE(again.ok());
  EXPECT_EQ(profileJson(*again), profileJson(*profile));
}

TEST(NeedleSection, ofAnOlderProfileIsWrittenUnchanged) {
  const auto profile = withNeedle(R"({"length_m": 0.06})");
  ASSERT_TRUE(profile.ok());
  EXPECT_THAT(profileJson(*profile), HasSubstr("\"needle\": {\"length_m\": 0.06},"));
  EXPECT_EQ(needleOf(profile->needle()).outer_diameter_m, 0);
  EXPECT_EQ(openingBehindTip_m(needleOf(profile->needle())), 0);
  EXPECT_EQ(sceneSpecOf(*profile)->needle_diameter_m, 0);
}

TEST(NeedleSection, aGaugeGivesTheDiameter) {
  const auto profile = withNeedle(R"({"length_m": 0.06, "gauge": 22})");
  ASSERT_TRUE(profile.ok());
  EXPECT_EQ(needleOf(profile->needle()).outer_diameter_m, 0.0007);
  EXPECT_EQ(sceneSpecOf(*profile)->needle_diameter_m, 0.0007);
}

TEST(NeedleSection, whatContradictsItselfIsRefusedWithTheNumbers) {
  const struct {
    const char *needle, *expected;
  } cases[] = {
      {R"({"length_m": 0.06, "gauge": 22, "outer_diameter_m": 0.0012})",
       "needle.outer_diameter_m: 0.0012 contradicts gauge 22, which is 7e-04 (allowed is 0.000644 to "
       "0.000756)"},
      {R"({"length_m": 0.06, "gauge": 9})", "needle.gauge: 9 is out of range [10, 34]"},
      {R"({"length_m": 0.06, "gauge": 22.5})", "needle.gauge"},
      {R"({"length_m": 0.06, "outer_diameter_m": 0.02})", "needle.outer_diameter_m: 0.02 is out of range"},
      {R"({"length_m": 0.06, "tip": "BLUNT"})", "needle.tip"},
      {R"({"length_m": 0.06, "tip": "TIP_UNSPECIFIED"})", "needle.tip"},
      {R"({"length_m": 0.06, "bevel_angle_rad": 0})", "needle.bevel_angle_rad: 0 is out of range"},
      {R"({"length_m": 0.06, "bevel_angle_rad": 1.6})", "needle.bevel_angle_rad: 1.6 is out of range"},
      {R"({"length_m": 0.02, "gauge": 10, "bevel_angle_rad": 0.1})",
       "needle.bevel_angle_rad: at 0.1 rad a tip of 3.4 mm diameter is 33.9 mm long, the whole needle 20 mm"},
  };
  for (const auto& c : cases) {
    const auto profile = withNeedle(c.needle);
    ASSERT_FALSE(profile.ok()) << c.needle;
    EXPECT_EQ(profile.error().code, ErrorCode::kInvalidInput);
    EXPECT_THAT(profile.error().message, HasSubstr(c.expected));
  }
}

TEST(NeedleSection, realTubesOfAGaugeAreTaken) {
  // outer diameters as manufacturers state them, by wire gauge, beside the metric sizes of ISO 9626
  const struct {
    int gauge;
    const char* diameter_m;
  } tubes[] = {{16, "0.001651"},  {17, "0.001473"},  {18, "0.00127"},   {19, "0.001067"},
               {20, "0.0009081"}, {21, "0.0008192"}, {22, "0.0007176"}, {23, "0.0006414"},
               {25, "0.0005144"}, {27, "0.0004128"}, {30, "0.0003112"}};
  for (const auto& tube : tubes) {
    const auto profile = withNeedle("{\"length_m\": 0.06, \"gauge\": " + std::to_string(tube.gauge) +
                                    ", \"outer_diameter_m\": " + tube.diameter_m + "}");
    EXPECT_TRUE(profile.ok()) << profile.error().message;
  }
}

TEST(NeedleSection, anUnknownTipSizeIsReported) {
  const auto told = withNeedle(R"({"length_m": 0.06, "tip": "QUINCKE"})");
  ASSERT_TRUE(told.ok());
  const auto plain = withNeedle(R"({"length_m": 0.06, "tip": "QUINCKE", "gauge": 22})");
  ASSERT_TRUE(plain.ok());
  EXPECT_EQ(profileWarnings(*told).size(), profileWarnings(*plain).size() + 1);
  EXPECT_THAT(profileWarnings(*told).front(), HasSubstr("neither gauge nor outer_diameter_m"));
}

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

std::vector<std::string> warningsWith(const std::vector<std::pair<std::string, std::string>>& changes) {
  std::string text = kGoodProfile;
  for (const auto& [pointer, value] : changes) text = mutated(text, pointer, value);
  const auto profile = parseProfile(text, "p");
  EXPECT_TRUE(profile.ok()) << (profile.ok() ? "" : profile.error().message);
  return profile.ok() ? profileWarnings(*profile) : std::vector<std::string>{"not valid"};
}

TEST(Fidelity, isTheShareOfTheLayerWithTheRightForce) {
  // 0 to 1 N at 500 N/m: within 10 % of 1 N after 0.9 N / 500 N/m = 1.8 mm; half of a 3.6 mm layer is left
  EXPECT_DOUBLE_EQ(fidelity(0, 1, 500, 0.0036), 0.5);
  EXPECT_DOUBLE_EQ(fidelity(0, 1, 500, 0.018), 0.9);
  // 1 to 2 N: within 0.2 N of 2 N after 0.8 N
  EXPECT_DOUBLE_EQ(fidelity(1, 2, 500, 0.0032), 0.5);
  EXPECT_EQ(fidelity(0, 1, 500, 0.0018), 0);
  EXPECT_EQ(fidelity(0, 1, 500, 0.0001), 0) << "never negative";
  EXPECT_EQ(fidelity(2, 1, 500, 0.0001), 1) << "a falling force needs no way";
  EXPECT_EQ(fidelity(1, 1.05, 500, 0.0001), 1) << "a rise that no one notices";
  EXPECT_EQ(fidelity(0, 0, 500, 0.0001), 1);
}

TEST(ProfileWarnings, aThinLayerIsReportedWithItsNumbers) {
  // the skin of 3 mm has fidelity 1 − 0.9/1.5 = 0.4
  EXPECT_THAT(warningsWith({}),
              ElementsAre(AllOf(HasSubstr("layers[0] (skin, 3 mm)"), HasSubstr("fidelity 0.4"),
                                HasSubstr("from 0 to 1 N"), HasSubstr("500 N/m needs 2 mm"))));
  EXPECT_THAT(warningsWith({{"/layers/0/thickness_m", "0.0036"}}), IsEmpty()) << "0.5 is enough";
  EXPECT_THAT(warningsWith({{"/layers/0/thickness_m", "0.0035"}}), ElementsAre(HasSubstr("layers[0]")));
}

TEST(ProfileWarnings, aFallingStepMayBeThin) {
  EXPECT_THAT(warningsWith({{"/layers/0/thickness_m", "0.004"},
                            {"/layers/1/cutting_force_n", "0.5"},
                            {"/layers/1/thickness_m", "0.0001"}}),
              IsEmpty());
}

TEST(ProfileWarnings, withoutCuttingNoLayerIsTooThin) {
  EXPECT_THAT(warningsWith({{"/effects", R"(["PUNCTURE"])"}}), IsEmpty());
}

TEST(ProfileWarnings, aModelWithoutAWallRemembersMembranesOnly) {
  const std::pair<std::string, std::string> listed{"/effects", R"(["CUTTING", "CUT_MEMORY"])"},
      section{"/cut_memory", R"({"cutting_share": 0.3, "radius_m": 0.001})"},
      thick{"/layers/0/thickness_m", "0.004"};
  EXPECT_THAT(warningsWith({listed, section, thick}), IsEmpty());
  EXPECT_THAT(warningsWith({listed, section, thick, {"/axial_model", "\"DIRECT\""}, {"/direct", "{}"}}),
              ElementsAre(HasSubstr("CUT_MEMORY is listed, axial_model DIRECT has no wall that cuts")));
}

TEST(ProfileWarnings, boneNeedsAPerceptibleLayerOfBone) {
  const std::pair<std::string, std::string> listed{"/effects", R"(["CUTTING", "BONE"])"},
      section{"/bone", R"({"stiffness_n_per_m": 600, "friction_coefficient": 0.3})"},
      thick{"/layers/0/thickness_m", "0.004"}, thin{"/layers/1/thickness_m", "0.0001"},
      firm{"/layers/1/cutting_force_n", "4"}, bone{"/layers/1/tissue", "\"BONE\""};
  EXPECT_THAT(warningsWith({listed, section, thick}), ElementsAre(HasSubstr("no layer's tissue is BONE")));
  EXPECT_THAT(warningsWith({listed, section, thick, thin, firm, bone}), IsEmpty());
  EXPECT_THAT(warningsWith({{"/effects", R"(["CUTTING"])"}, thick, thin, firm, bone}),
              ElementsAre(HasSubstr("layers[1]")));
}

TEST(ProfileWarnings, aMembraneRupturingBelowItsLayerIsReported) {
  const std::pair<std::string, std::string> thick{"/layers/0/thickness_m", "0.004"};
  // 100 N/m alone reaches 0.6 N at 6 mm, in a layer of 4 mm
  const std::pair<std::string, std::string> soft{
      "/layers/0/puncture", R"({"linear_n_per_m": 100, "quadratic_n_per_m2": 0, "force_n": 0.6})"};
  EXPECT_THAT(warningsWith({thick, soft}), ElementsAre(AllOf(HasSubstr("layers[0] (skin, 4 mm)"),
                                                             HasSubstr("0.6 N"), HasSubstr("6 mm deep"))));
  // 100 z + 12500 z² = 0.6 at exactly 4 mm: not deeper than the layer with its small tolerance
  const std::pair<std::string, std::string> just{
      "/layers/0/puncture", R"({"linear_n_per_m": 100, "quadratic_n_per_m2": 12500, "force_n": 0.6})"};
  EXPECT_THAT(warningsWith({{"/layers/0/thickness_m", "0.00400001"}, just}), IsEmpty());
  EXPECT_THAT(warningsWith({{"/layers/0/thickness_m", "0.00399999"}, just}),
              ElementsAre(HasSubstr("4 mm deep")));
  // not listed, so no warning
  EXPECT_THAT(warningsWith({thick, soft, {"/effects", R"(["CUTTING"])"}}), IsEmpty());
}

}  // namespace
}  // namespace needlelab
