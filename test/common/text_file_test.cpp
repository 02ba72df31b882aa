#include "common/text_file.h"

#include <gmock/gmock.h>

#include <fstream>

#include "common/error.h"
#include "test/support/temporary_directory.h"

namespace livemap {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

TEST(DecodeText, SkipsUtf8sByteOrderMarkAtTheBeginningOfEachLine) {
  EXPECT_EQ(DecodeText("\xef\xbb\xbf# a\n1 2\n", "f"), "# a\n1 2\n");
  EXPECT_EQ(DecodeText("\xef\xbb\xbf\xef\xbb\xbf"
                       "1\r\n\xef\xbb\xbf"
                       "2",
                       "f"),
            "1\r\n2")
      << "of files that were joined";
  EXPECT_EQ(DecodeText("a\xef\xbb\xbf", "f"), "a\xef\xbb\xbf") << "within a line it is text";
  EXPECT_EQ(DecodeText("\xef\xbb\xbf", "f"), "");
}

TEST(DecodeText, ReadsLinesThatEndInACarriageReturnAlone) {
  EXPECT_EQ(DecodeText("1\r2\r", "f"), "1\n2\n");
  EXPECT_EQ(DecodeText("1\r\n2\r\n", "f"), "1\r\n2\r\n");
}

TEST(DecodeText, NamesTheEncodingThatIsNotAccepted) {
  using std::string;
  for (const auto& [bytes, words] : {std::pair(string("\xff\xfe"
                                                      "1\0",
                                                      4),
                                               "UTF-16"),
                                     std::pair(string("\xfe\xff\0"
                                                      "1",
                                                      4),
                                               "UTF-16"),
                                     std::pair(string("\xff\xfe\0\0", 4), "UTF-32"),
                                     std::pair(string("\0\0\xfe\xff", 4), "UTF-32"),
                                     std::pair(string("1\0 \0", 4), "zero byte at offset 1")}) {
    const string text = bytes;
    EXPECT_THAT([&] { DecodeText(text, "list.txt"); },
                ThrowsMessage<Error>(AllOf(HasSubstr("'list.txt'"), HasSubstr(words),
                                           HasSubstr("accepted is text in UTF-8"))));
  }
}

TEST(ReadTextFile, DecodesAFileAndNamesIt) {
  const test::TemporaryDirectory folder;
  const std::string path = folder.path() + "/list.txt";
  std::ofstream(path) << "\xef\xbb\xbf"
                         "1 2\n";
  EXPECT_EQ(ReadTextFile(path, 100), "1 2\n");
  EXPECT_THAT([&] { ReadTextFile(path, 3); }, ThrowsMessage<Error>(HasSubstr(path)));
  EXPECT_THAT([&] { ReadTextFile(path + "x", 3); }, ThrowsMessage<Error>(HasSubstr(path)));
}

}  // namespace
}  // namespace livemap
