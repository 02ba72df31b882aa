#include "zone/pictures/picture_queue.h"

#include <gtest/gtest.h>

#include <fstream>
#include <future>
#include <mutex>

#include "common/error.h"
#include "test/zone/zone_fixture.h"

namespace livemap::zone {
namespace {

using Bytes = std::vector<std::uint8_t>;

/// The decoder stands still at the first picture until the test lets it go.
class PictureQueueTest : public ZoneTest {
 protected:
  void SetUp() override {
    ZoneTest::SetUp();
    path_ = directory_ + "/picture";
    std::ofstream(path_) << "x";
    EXPECT_TRUE(Ask("first", "first"));
    decoding_.get_future().wait();
  }

  PictureCache::Recode Decoder() {
    return [this](const Bytes& file) {
      if (decoded_++ == 0) {
        decoding_.set_value();
        release_.get_future().wait();
      }
      return file;
    };
  }
  bool Ask(const std::string& client, const std::string& name) {
    return queue_.Ask(client, name, path_, [this, name](const PictureCache::File&) {
      const std::lock_guard lock(mutex_);
      done_.push_back(name);
      if (done_.size() == wanted_) all_.set_value();
    });
  }
  std::vector<std::string> AwaitAll(std::size_t wanted) {
    {
      const std::lock_guard lock(mutex_);
      wanted_ = wanted;
    }
    release_.set_value();
    all_.get_future().wait();
    const std::lock_guard lock(mutex_);
    return done_;
  }

  std::string path_;
  int decoded_ = 0;  ///< The queue's thread alone.
  std::promise<void> decoding_;
  std::promise<void> release_;
  std::promise<void> all_;
  std::mutex mutex_;
  std::vector<std::string> done_;
  std::size_t wanted_ = 0;
  PictureCache cache_{Decoder(), {}};
  PictureQueue queue_{cache_, {6, 4}};
};

TEST_F(PictureQueueTest, ClientsTakeTurnsHoweverManyPicturesOneAsksFor) {
  for (const char* name : {"a1", "a2", "a3"}) EXPECT_TRUE(Ask("a", name));
  EXPECT_TRUE(Ask("b", "b1"));
  EXPECT_EQ(AwaitAll(5), (std::vector<std::string>{"first", "a1", "b1", "a2", "a3"}));
}

TEST_F(PictureQueueTest, TakesNoMoreThanAClientAndAllTogetherMayHave) {
  for (const char* name : {"a1", "a2", "a3", "a4"}) EXPECT_TRUE(Ask("a", name));
  EXPECT_FALSE(Ask("a", "a5"));
  EXPECT_TRUE(Ask("b", "b1"));
  EXPECT_TRUE(Ask("b", "b2"));
  EXPECT_FALSE(Ask("c", "c1"));
  EXPECT_EQ(queue_.busy(), 2U);
  EXPECT_EQ(AwaitAll(7).size(), 7U);
}

TEST_F(PictureQueueTest, APictureThatIsKeptIsAnsweredAtOnce) {
  EXPECT_EQ(AwaitAll(1).size(), 1U);
  bool answered = false;
  EXPECT_TRUE(queue_.Ask("a", "first", path_,
                         [&](const PictureCache::File& file) { answered = file != nullptr; }));
  EXPECT_TRUE(answered);
}

}  // namespace
}  // namespace livemap::zone
