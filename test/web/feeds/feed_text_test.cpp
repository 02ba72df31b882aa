#include "web/feeds/feed_text.h"

#include <gtest/gtest.h>

#include <string>

namespace livemap::web {
namespace {

TEST(XmlText, EscapesMarkup) {
  EXPECT_EQ(XmlText("<script>a & 'b' \"c\"</script>"),
            "&lt;script&gt;a &amp; &apos;b&apos; &quot;c&quot;&lt;/script&gt;");
}

TEST(XmlText, ReplacesWhatXmlDoesNotHave) {
  EXPECT_EQ(XmlText(std::string("a\0b\x01\x7f", 5)), "a\uFFFDb\uFFFD\uFFFD");
  EXPECT_EQ(XmlText("\uFFFF\uFFFE"), "\uFFFD\uFFFD");
  EXPECT_EQ(XmlText("Z\u00fcrich \U0001F98C"), "Z\u00fcrich \U0001F98C");
}

TEST(XmlText, ReplacesWhatIsNoUtf8) {
  EXPECT_EQ(XmlText("\xff\xc3"), "\uFFFD\uFFFD");
  EXPECT_EQ(XmlText("\xc0\xaf"), "\uFFFD\uFFFD");                 // Overlong.
  EXPECT_EQ(XmlText("\xed\xa0\x80"), "\uFFFD\uFFFD\uFFFD");       // Half of a surrogate pair.
  EXPECT_EQ(XmlText("\xf4\x90\x80\x80").substr(0, 3), "\uFFFD");  // Beyond U+10FFFF.
}

TEST(CsvText, QuotesWhatRfc4180SaysAndDoublesQuotes) {
  EXPECT_EQ(CsvText("plain"), "plain");
  EXPECT_EQ(CsvText(""), "");
  EXPECT_EQ(CsvText("Forbes Ave"), "\"Forbes Ave\"");
  EXPECT_EQ(CsvText("a,b"), "\"a,b\"");
  EXPECT_EQ(CsvText("the \"Strip\""), "\"the \"\"Strip\"\"\"");
  EXPECT_EQ(CsvText("two\r\nlines"), "\"two\r\nlines\"");
}

TEST(CsvText, KeepsSpreadsheetsFromRunningIt) {
  for (const char* text : {"=1+1", "+1", "-1", "@SUM(A1)", "\t=1", "\r=1", "  =1", "|calc"}) {
    const std::string field = CsvText(text);
    EXPECT_EQ(field.substr(0, 2), "\"'") << field;
  }
  EXPECT_EQ(CsvText(std::string("\0@", 2)), "\uFFFD@");
  EXPECT_EQ(CsvText("=HYPERLINK(\"http://evil\")"), "\"'=HYPERLINK(\"\"http://evil\"\")\"");
}

TEST(AppendCoordinate, WritesNoExponent) {
  std::string text;
  AppendCoordinate(text, -1e-7);
  EXPECT_EQ(text, "-0.0000001");
}

}  // namespace
}  // namespace livemap::web
