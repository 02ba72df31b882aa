#include "zone/pictures/picture_cache.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <fstream>
#include <future>

#include "common/error.h"
#include "test/zone/zone_fixture.h"

namespace livemap::zone {
namespace {

using Bytes = std::vector<std::uint8_t>;

/// Stands in for the decoder: serves a file's bytes unchanged and refuses those that begin with a
/// zero. A file that begins with kSlow is held until the test lets it go.
constexpr std::uint8_t kSlow = 1;
constexpr std::uint8_t kFast = 2;

class PictureCacheTest : public ZoneTest {
 protected:
  std::string Write(const std::string& name, const Bytes& bytes) {
    const std::string path = directory_ + "/" + name;
    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
    return path;
  }

  PictureCache::Recode Decoder() {
    return [this](const Bytes& file) {
      ++decoded_;
      if (file.front() == 0) throw Error("no picture");
      if (file.front() == kSlow) {
        decoding_.set_value();
        release_.get_future().wait();
      }
      return file;
    };
  }

  std::atomic<int> decoded_{0};
  std::promise<void> decoding_;  ///< The slow file is in the decoder.
  std::promise<void> release_;   ///< The slow file may leave it.
};

TEST_F(PictureCacheTest, DecodesOnceAndForgetsWhatWasNotAskedForLongest) {
  const std::string path = Write("a", Bytes(1000, kFast));
  PictureCache pictures(Decoder(), {1 << 20, 2600});
  const auto first = pictures.Get("a", path);
  ASSERT_TRUE(first);
  EXPECT_EQ(*first, Bytes(1000, kFast));
  EXPECT_EQ(pictures.Get("a", path), first) << "decoded twice";
  pictures.Get("b", path);
  pictures.Get("a", path);
  pictures.Get("c", path);
  EXPECT_LE(pictures.total_bytes(), 2600U);
  EXPECT_EQ(pictures.Get("a", path), first) << "the one that was asked for is gone";
  EXPECT_FALSE(pictures.Find("b"));
  EXPECT_EQ(decoded_, 3);
}

TEST_F(PictureCacheTest, WhatIsNotAcceptedIsRememberedWhatIsMissingIsNot) {
  PictureCache pictures(Decoder(), {1 << 20, 1 << 20});
  const std::string path = Write("bad", {0, 1, 2});
  EXPECT_FALSE(pictures.Get("bad", path));
  Write("bad", {kFast});
  EXPECT_FALSE(pictures.Get("bad", path)) << "a hostile picture is decoded again and again";
  ASSERT_TRUE(pictures.Find("bad"));
  EXPECT_FALSE(*pictures.Find("bad"));
  EXPECT_EQ(pictures.refused(), 1U);
  EXPECT_FALSE(pictures.Get("late", directory_ + "/late"));
  EXPECT_TRUE(pictures.Get("late", Write("late", {kFast})));
  EXPECT_EQ(pictures.refused(), 1U);
}

TEST_F(PictureCacheTest, AFileBeyondTheLimitIsNotRead) {
  PictureCache pictures(Decoder(), {100, 1 << 20});
  EXPECT_FALSE(pictures.Get("large", Write("large", Bytes(101, kFast))));
  EXPECT_EQ(decoded_, 0);
}

TEST_F(PictureCacheTest, TheBoundHoldsForRefusedPicturesToo) {
  PictureCache pictures(Decoder(), {1 << 20, 4096});
  const std::string path = Write("bad", {0});
  for (int i = 0; i < 200; ++i) pictures.Get(std::to_string(i), path);
  EXPECT_LE(pictures.total_bytes(), 4096U);
}

TEST_F(PictureCacheTest, AKeptPictureDoesNotWaitForTheDecodingOfAnother) {
  PictureCache pictures(Decoder(), {1 << 20, 1 << 20});
  const std::string fast = Write("fast", {kFast});
  const std::string slow = Write("slow", {kSlow});
  pictures.Get("fast", fast);
  auto other = std::async(std::launch::async, [&] { return pictures.Get("slow", slow); });
  decoding_.get_future().wait();
  auto hit = std::async(std::launch::async, [&] {
    return pictures.Find("fast").has_value() && pictures.Get("fast", fast) != nullptr;
  });
  const auto answered = hit.wait_for(std::chrono::seconds(30));
  release_.set_value();
  EXPECT_EQ(answered, std::future_status::ready) << "the hit waited for the decoder";
  EXPECT_TRUE(hit.get());
  EXPECT_TRUE(other.get());
}

TEST_F(PictureCacheTest, APictureThatTwoAskForAtOnceIsDecodedOnce) {
  PictureCache pictures(Decoder(), {1 << 20, 1 << 20});
  const std::string slow = Write("slow", {kSlow});
  const auto ask = [&] { return pictures.Get("slow", slow); };
  auto first = std::async(std::launch::async, ask);
  decoding_.get_future().wait();
  // Not kept yet, so this request finds nothing and has to wait for the first.
  auto second = std::async(std::launch::async, ask);
  release_.set_value();
  EXPECT_EQ(first.get(), second.get());
  EXPECT_EQ(decoded_, 1);
}

}  // namespace
}  // namespace livemap::zone
