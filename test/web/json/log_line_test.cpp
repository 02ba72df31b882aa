#include "web/json/log_line.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

namespace livemap::web {
namespace {

LogRecord SampleRecord(const std::string& message) {
  return {1'767'225'600'250'000'000, "warning", message, "zone_cloudlet", "zone_node.cpp", 159};
}

TEST(LogLine, IsOneObject) {
  EXPECT_EQ(LogLine(SampleRecord("report refused")),
            R"({"time":"2026-01-01T00:00:00.250Z","level":"warning","message":"report refused",)"
            R"("fields":{"node":"zone_cloudlet","file":"zone_node.cpp","line":159}})");
}

TEST(LogLine, AMessageCannotBeginAnotherLine) {
  const std::string hostile = "x\n{\"level\":\"error\"}\r\xff\"";
  const std::string line = LogLine(SampleRecord(hostile));
  EXPECT_EQ(line.find('\n'), std::string::npos);
  EXPECT_EQ(line.find('\r'), std::string::npos);
  const auto json = nlohmann::json::parse(line);
  EXPECT_EQ(json["level"], "warning");
  EXPECT_EQ(json["message"], "x\n{\"level\":\"error\"}\r\uFFFD\"");
}

TEST(LogLine, WithoutASourceHasNoFile) {
  EXPECT_FALSE(nlohmann::json::parse(LogLine({}))["fields"].contains("file"));
}

}  // namespace
}  // namespace livemap::web
