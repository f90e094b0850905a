#include "db/station_store.h"

#include "tests/unit/db/test_db.h"

namespace needlelab {
namespace {

std::string textOfKey(const StationKeyBytes& key) {
  return {key.begin(), key.end()};
}

TEST(StationStore, takesTheRightKeyOnly) {
  test::TestDb db;
  StationStore stations(db.writer);
  const StationKeyBytes key = makeStationKey();
  ASSERT_OK(stations.add("lab-1", hashStationKey(key), 5));
  EXPECT_TRUE(*stations.checkKey("lab-1", textOfKey(key)));
  auto wrong = key;
  wrong[31] ^= 1;
  EXPECT_FALSE(*stations.checkKey("lab-1", textOfKey(wrong)));
  EXPECT_FALSE(*stations.checkKey("lab-1", textOfKey(key).substr(1)));
  EXPECT_FALSE(*stations.checkKey("lab-1", textOfKey(key) + "x"));
  EXPECT_FALSE(*stations.checkKey("lab-1", ""));
  EXPECT_FALSE(*stations.checkKey("lab-2", textOfKey(key)));
  // what is stored is not the key
  EXPECT_FALSE(*stations.checkKey("lab-1", textOfKey(hashStationKey(key))));
}

TEST(StationStore, aRevokedStationIsOutUntilItGetsANewKey) {
  test::TestDb db;
  StationStore stations(db.writer);
  const StationKeyBytes old_key = makeStationKey(), new_key = makeStationKey();
  ASSERT_OK(stations.add("lab-1", hashStationKey(old_key), 5));
  EXPECT_EQ(stations.add("lab-1", hashStationKey(new_key), 6).error().code, ErrorCode::kAlreadyExists);
  ASSERT_OK(stations.revoke("lab-1"));
  EXPECT_FALSE(*stations.checkKey("lab-1", textOfKey(old_key)));
  ASSERT_OK(stations.add("lab-1", hashStationKey(new_key), 7));
  EXPECT_FALSE(*stations.checkKey("lab-1", textOfKey(old_key)));
  EXPECT_TRUE(*stations.checkKey("lab-1", textOfKey(new_key)));
  EXPECT_EQ(stations.find("lab-1")->value().created_unix_ns, 5);
  EXPECT_EQ(stations.revoke("nobody").error().code, ErrorCode::kNotFound);
  EXPECT_EQ(stations.list()->size(), 2u);
}

}  // namespace
}  // namespace needlelab
