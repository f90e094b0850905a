// Finding the vendor's library, and parsing the address.
#include <gmock/gmock.h>

#include <cstdlib>

#include "client/device/virtuose/virtuose_api.h"
#include "client/device/virtuose/virtuose_device.h"
#include "client/device/virtuose/virtuose_link.h"
#include "tests/support/virtuose_standin/control.h"

namespace needlelab::test {
namespace {

using testing::HasSubstr;

// Sets the variable for one test.
class LibraryVariable {
 public:
  explicit LibraryVariable(const char* value) { ::setenv(kVirtuoseLibraryVariable, value, 1); }
  ~LibraryVariable() { ::unsetenv(kVirtuoseLibraryVariable); }
  LibraryVariable(const LibraryVariable&) = delete;
  LibraryVariable& operator=(const LibraryVariable&) = delete;
};

TEST(VirtuoseApi, aMissingLibraryNamesItsVendorAndPlace) {
  const auto api = loadVirtuoseApi("/nowhere/libVirtuoseAPI.so");
  ASSERT_FALSE(api.ok());
  EXPECT_EQ(api.error().code, ErrorCode::kNotFound);
  for (const char* part : {"/nowhere/libVirtuoseAPI.so", "Haption", "does not come with needlelab",
                           "ldconfig", "NEEDLELAB_VIRTUOSE_LIBRARY"})
    EXPECT_THAT(api.error().message, HasSubstr(part));
}

TEST(VirtuoseApi, everyMissingFunctionIsNamed) {
  const auto api = loadVirtuoseApi(kIncompleteLibrary);
  ASSERT_FALSE(api.ok());
  EXPECT_EQ(api.error().code, ErrorCode::kVersion);
  for (const char* name :
       {"virtGetErrorCode",        "virtGetErrorMessage",  "virtSetIndexingMode", "virtSetForceFactor",
        "virtSetSpeedFactor",      "virtSetTimeStep",      "virtSetTimeoutValue", "virtSetBaseFrame",
        "virtSetObservationFrame", "virtSetCommandType",   "virtSetPowerOn",      "virtSaturateTorque",
        "virtGetPosition",         "virtGetSpeed",         "virtSetForce",        "virtGetButton",
        "virtGetDeadMan",          "virtGetEmergencyStop", "virtGetPowerOn",      "virtGetAlarm",
        "virtGetFailure"})
    EXPECT_THAT(api.error().message, HasSubstr(name));
  EXPECT_THAT(api.error().message, testing::Not(HasSubstr("virtOpen")));
}

TEST(VirtuoseApi, theVariableComesFirstAndIsNotPassedOver) {
  {
    const LibraryVariable set(kStandinLibrary.c_str());
    const auto api = loadVirtuoseApi();
    ASSERT_TRUE(api.ok()) << api.error().message;
    EXPECT_EQ(api->path, kStandinLibrary);
    EXPECT_EQ(virtuoseLibraryVersion(*api), "3.98");
  }
  {
    const LibraryVariable set("/nowhere/x.so");
    const auto api = loadVirtuoseApi();
    ASSERT_FALSE(api.ok());
    EXPECT_THAT(api.error().message, HasSubstr("that NEEDLELAB_VIRTUOSE_LIBRARY names"));
    EXPECT_THAT(api.error().message, HasSubstr("/nowhere/x.so"));
  }
  // An empty variable counts as unset: the system is searched for the plain name.
  const LibraryVariable set("");
  const auto api = loadVirtuoseApi();
  if (!api.ok()) {
    EXPECT_THAT(api.error().message, HasSubstr("cannot be loaded: libVirtuoseAPI.so"));
  }
}

TEST(VirtuoseApi, aDeviceWithoutLibraryDoesNotOpen) {
  VirtuoseOptions options;
  options.library = "/nowhere/libVirtuoseAPI.so";
  VirtuoseDevice device(options);
  const Status status = device.open(1000);
  ASSERT_FALSE(status.ok());
  EXPECT_THAT(status.error().message, HasSubstr("Haption"));
  DeviceReading reading;
  EXPECT_EQ(device.read(reading), DeviceRead::kNoUpdate);
  device.write({});
  device.maintain();
  EXPECT_EQ(device.status(), "");
  device.close();
  device.close();
}

TEST(VirtuoseAddress, isHostAndPortWithTheVendorsDefaults) {
  EXPECT_EQ(*virtuoseAddress(""), "127.0.0.1#53210");
  EXPECT_EQ(*virtuoseAddress("haptic.lab"), "haptic.lab#53210");
  EXPECT_EQ(*virtuoseAddress("192.168.100.53#5000"), "192.168.100.53#5000");
  for (const char* wrong : {"#53210", "host#", "host#0", "host#65536", "host#x", "host#12x", "a b#1", "h:1",
                            "h#-1", "udp://h#1"}) {
    const auto address = virtuoseAddress(wrong);
    ASSERT_FALSE(address.ok()) << wrong;
    EXPECT_EQ(address.error().code, ErrorCode::kInvalidInput);
    EXPECT_THAT(address.error().message, HasSubstr(std::string("virtuose:") + wrong));
    EXPECT_THAT(address.error().message, HasSubstr("HOST#PORT"));
  }
}

TEST(VirtuoseList, saysWhetherLibraryDeviceAndStateAreThere) {
  const Standin standin;
  const struct {
    const char *command, *undo, *library, *words;
  } rows[] = {
      {"link_down 0", "link_down 0", kStandinLibrary.c_str(), "it answers"},
      {"estop press", "estop free", kStandinLibrary.c_str(), "emergency stop"},
      {"failure 0x2", "failure 0", kStandinLibrary.c_str(), "encoder 2"},
      {"fail virtGetAlarm 11", "fail virtGetAlarm 0", kStandinLibrary.c_str(), "hardware error"},
      {"daemon 0", "daemon 1", kStandinLibrary.c_str(), "no device answers at 127.0.0.1#53210: error 2"},
      {"link_down 0", "link_down 0", "/nowhere.so", "Haption"},
  };
  for (const auto& row : rows) {
    standin.command(row.command);
    const FoundDevice found = listVirtuose(kVirtuoseAddress, row.library).at(0);
    EXPECT_EQ(found.ready, &row == rows) << found.state;
    EXPECT_EQ(found.spec, "virtuose:127.0.0.1#53210");
    EXPECT_THAT(found.state, HasSubstr(row.words));
    if (&row == rows) {
      EXPECT_THAT(found.name, HasSubstr("library 3.98, device software 3.98"));
      EXPECT_EQ(standin.calls(), "virtOpen virtClose");  // no power, no force, no settings
    }
    EXPECT_EQ(standin.state().open_contexts, 0);
    standin.command(row.undo);
  }
}

}  // namespace
}  // namespace needlelab::test
