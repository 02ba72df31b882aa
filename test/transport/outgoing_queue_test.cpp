#include "transport/outgoing_queue.h"

#include <gtest/gtest.h>

namespace livemap::transport {
namespace {

OutgoingMessage Message(std::size_t bytes, std::uint64_t tag = 0) {
  return {"", std::vector<std::uint8_t>(bytes), 1, tag};
}

TEST(OutgoingQueue, GivesBackInOrder) {
  OutgoingQueue queue(10, 100);
  ASSERT_TRUE(queue.Push(Message(1, 1)));
  ASSERT_TRUE(queue.Push(Message(1, 2)));
  EXPECT_EQ(queue.Pop()->tag, 1U);
  EXPECT_EQ(queue.Pop()->tag, 2U);
  EXPECT_FALSE(queue.Pop());
}

TEST(OutgoingQueue, RefusesMoreMessagesThanItsBound) {
  OutgoingQueue queue(2, 100);
  EXPECT_TRUE(queue.Push(Message(1)));
  EXPECT_TRUE(queue.Push(Message(1)));
  EXPECT_FALSE(queue.Push(Message(1)));
  queue.Pop();
  EXPECT_TRUE(queue.Push(Message(1)));
}

TEST(OutgoingQueue, RefusesMoreBytesThanItsBoundAndCountsTopics) {
  OutgoingQueue queue(10, 100);
  EXPECT_TRUE(queue.Push({"0123456789", std::vector<std::uint8_t>(80), 1, 0}));
  EXPECT_FALSE(queue.Push(Message(11)));
  EXPECT_TRUE(queue.Push(Message(10)));
  queue.Pop();
  EXPECT_TRUE(queue.Push(Message(90)));
  EXPECT_FALSE(queue.Push(Message(101)));
  EXPECT_EQ(queue.size(), 2U);
}

}  // namespace
}  // namespace livemap::transport
