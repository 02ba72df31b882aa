#include "zone/pictures/image_store.h"

#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <fstream>

#include "common/clock.h"
#include "common/error.h"
#include "common/sha256.h"
#include "common/sqlite.h"
#include "test/zone/zone_fixture.h"

namespace livemap::zone {
namespace {

using Bytes = std::vector<std::uint8_t>;

class ImageStoreTest : public ZoneTest {
 protected:
  static std::string Keep(ImageStore& store, const Bytes& bytes) {
    const std::string name = store.Put(bytes, "jpeg");
    store.Publish();
    return name;
  }
  std::string Directory() const { return directory_ + "/images"; }
};

TEST_F(ImageStoreTest, KeepsAPictureUnderItsHashOnce) {
  ImageStore store(Directory(), 1 << 20);
  const Bytes bytes = MakeJpeg(10, 10, 100);
  const std::string name = store.Put(bytes, "jpeg");
  EXPECT_FALSE(store.Path(name));
  store.Publish();
  EXPECT_EQ(name, Sha256Hex(bytes.data(), bytes.size()));
  EXPECT_EQ(Keep(store, bytes), name);
  EXPECT_EQ(store.total_bytes(), bytes.size());
  ASSERT_TRUE(store.Path(name));
  EXPECT_EQ(ReadFile(*store.Path(name), 10000), std::string(bytes.begin(), bytes.end()));
}

TEST_F(ImageStoreTest, GivesNoPathForAnythingButAKnownHash) {
  ImageStore store(Directory(), 1 << 20);
  const std::string name = Keep(store, MakeJpeg(10, 10));
  std::string upper = name;
  upper[0] = 'A';
  for (const std::string& text : {std::string(), std::string("../zone.sqlite3"), upper, name + "0",
                                  name.substr(1), std::string(64, '/'), std::string(64, '0')}) {
    EXPECT_FALSE(store.Path(text)) << text;
  }
}

TEST_F(ImageStoreTest, EvictsUnreferencedPicturesFirstAndThenTheOldest) {
  ImageStore store(Directory(), 3 * 1021);
  const auto put = [&](std::uint8_t value) { return Keep(store, MakeJpeg(9, 9, 1000, value)); };
  const std::string oldest = put(1);
  const std::string unreferenced = put(2);
  const std::string middle = put(3);
  const std::string newest = put(4);
  for (const std::string& name : {oldest, middle, newest}) store.Retain(name);
  store.EvictBeyondCap();
  EXPECT_FALSE(store.Path(unreferenced));
  EXPECT_TRUE(store.Path(oldest));
  const std::string next = put(5);
  store.Retain(next);
  store.EvictBeyondCap();
  EXPECT_FALSE(store.Path(oldest));
  store.Release(middle);
  store.Retain(put(6));
  store.EvictBeyondCap();
  EXPECT_FALSE(store.Path(middle));
  EXPECT_TRUE(store.Path(newest));
  EXPECT_LE(store.total_bytes(), 3U * 1021U);
}

TEST_F(ImageStoreTest, KnowsItsPicturesAfterARestartAndClearsWhatAnInterruptedWriteLeft) {
  std::string name;
  {
    ImageStore store(Directory(), 1 << 20);
    name = Keep(store, MakeJpeg(10, 10));
  }
  const std::string leftover = Directory() + "/" + name.substr(0, 2) + "/" + name + ".png.tmp";
  std::ofstream(leftover) << "half";
  const ImageStore store(Directory(), 1 << 20);
  EXPECT_TRUE(store.Path(name));
  EXPECT_FALSE(std::filesystem::exists(leftover));
}

TEST_F(ImageStoreTest, SaysSoWhenItCannotWrite) {
  ImageStore store(Directory(), 1 << 20);
  std::filesystem::remove_all(Directory());
  std::ofstream(Directory()) << "a file stands in the way";
  EXPECT_THROW(store.Put(MakeJpeg(10, 10), "jpeg"), StoreError);
  EXPECT_THROW(ImageStore(Directory(), 1), StoreError);
}

TEST_F(ImageStoreTest, DeletesPicturesThatWereStoredLongAgoAFewAtATime) {
  std::vector<std::string> names;
  {
    ImageStore store(Directory(), 1 << 20);
    for (std::uint8_t i = 0; i < 4; ++i) names.push_back(Keep(store, MakeJpeg(9, 9, 10, i)));
    const auto now = std::filesystem::file_time_type::clock::now();
    for (int i = 0; i < 3; ++i) {
      std::filesystem::last_write_time(*store.Path(names[static_cast<std::size_t>(i)]),
                                       now - std::chrono::hours(24 * (10 - i)));
    }
  }
  ImageStore store(Directory(), 1 << 20);
  store.Retain(names[0]);
  const std::int64_t week_ago_ns = SystemNs() - 7 * kOneDay - kOneDay / 2;
  EXPECT_EQ(store.RemoveOlder(week_ago_ns, 2), 2U);
  EXPECT_FALSE(store.Path(names[0])) << "though a hazard shows it";
  EXPECT_FALSE(store.Path(names[1]));
  EXPECT_TRUE(store.Path(names[2]));
  EXPECT_EQ(store.RemoveOlder(week_ago_ns, 2), 1U);
  EXPECT_EQ(store.RemoveOlder(week_ago_ns, 2), 0U);
  EXPECT_TRUE(store.Path(names[3]));
  store.Release(names[0]);
  EXPECT_TRUE(store.Remove(names[3]));
  EXPECT_FALSE(store.Remove(names[3]));
  EXPECT_EQ(store.total_bytes(), 0U);
}

}  // namespace
}  // namespace livemap::zone
