#include "common/queues/turns.h"

#include <gtest/gtest.h>

#include <vector>

namespace livemap {
namespace {

TEST(Turns, ClientsTakeTurnsAndKeepTheirOwnOrder) {
  Turns<std::string> waiting;
  for (const char* item : {"a1", "a2", "a3"}) waiting.Put("a", item);
  waiting.Put("b", "b1");
  waiting.Put("c", "c1");
  waiting.Put("b", "b2");
  EXPECT_EQ(waiting.size(), 6U);
  EXPECT_EQ(waiting.SizeOf("a"), 3U);
  EXPECT_EQ(waiting.SizeOf("nobody"), 0U);
  std::vector<std::string> taken;
  while (!waiting.IsEmpty()) taken.push_back(waiting.TakeNext());
  EXPECT_EQ(taken, (std::vector<std::string>{"a1", "b1", "c1", "a2", "b2", "a3"}));
}

TEST(Turns, AClientThatComesBackAtOnceWaitsForTheOthers) {
  Turns<std::string> waiting;
  waiting.Put("a", "a1");
  waiting.Put("b", "b1");
  EXPECT_EQ(waiting.TakeNext(), "a1");
  waiting.Put("a", "a2");
  EXPECT_EQ(waiting.TakeNext(), "b1");
  EXPECT_EQ(waiting.TakeNext(), "a2");
}

}  // namespace
}  // namespace livemap
