#include "web/api/collections.h"

#include <gtest/gtest.h>

#include <functional>

#include "web/json/json.h"
#include "zone/model/hazard.h"

namespace livemap::web {
namespace {

TEST(ListAnswer, ReadsOnceAtATimeAlsoWhereNothingMatches) {
  int reads = 0;
  zone::Walk<zone::HazardState> walk;
  walk.until = 7;
  using Read = std::function<zone::Page<zone::Hazard>(const zone::Walk<zone::HazardState>& where,
                                                      std::size_t limit)>;
  const Read read = [&reads](const auto& where, std::size_t) {
    zone::Page<zone::Hazard> page;
    page.sequence = where.after + 1;
    page.is_last = ++reads == 5;
    if (page.is_last) page.items.emplace_back();
    return page;
  };
  const HttpResponse answer =
      ListAnswer(walk, 100, Uuid{}, read, [](const zone::Hazard&) { return Json::object(); });
  std::string piece;
  for (int i = 1; i < 5; ++i) {
    ASSERT_TRUE(answer.pieces(piece));
    ASSERT_EQ(reads, i);
  }
  EXPECT_FALSE(answer.pieces(piece));
  EXPECT_EQ(piece, R"({"type":"FeatureCollection","features":[{}],"sequence":7,"truncated":false,)"
                   R"("log":"00000000-0000-0000-0000-000000000000"})");
}

}  // namespace
}  // namespace livemap::web
