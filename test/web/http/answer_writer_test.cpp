#include "web/http/answer_writer.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <array>
#include <stdexcept>

#include "web/http/gzip_stream.h"

namespace livemap::web {
namespace {

/// All parts one after the other, and the largest of them.
struct Written {
  std::string wire;
  std::size_t largest_part = 0;

  std::string Header() const { return wire.substr(0, wire.find("\r\n\r\n") + 4); }
  std::string Content() const { return wire.substr(wire.find("\r\n\r\n") + 4); }
};

Written Write(AnswerWriter& writer) {
  Written written;
  std::string part;
  while (writer.Next(part)) {
    written.wire += part;
    written.largest_part = std::max(written.largest_part, part.size());
  }
  return written;
}

/// `count` lines, each made when it is asked for.
HttpResponse Lines(int count, int* made = nullptr) {
  return PiecesAnswer(
      [count, made, line = 0](std::string& piece) mutable {
        piece += "line " + std::to_string(line++) + std::string(1000, '.') + "\n";
        if (made != nullptr) ++*made;
        return line < count;
      },
      "application/x-ndjson");
}

std::string LinesText(int count) {
  std::string text;
  for (int i = 0; i < count; ++i) {
    text += "line " + std::to_string(i) + std::string(1000, '.') + "\n";
  }
  return text;
}

std::string Unchunked(const std::string& content) {
  std::string text;
  std::size_t at = 0;
  while (true) {
    const std::size_t end = content.find("\r\n", at);
    if (end == std::string::npos) throw std::runtime_error("cut off");
    const std::size_t bytes = std::stoul(content.substr(at, end - at), nullptr, 16);
    if (bytes == 0) return content.substr(end) == "\r\n\r\n" ? text : throw std::runtime_error("?");
    text += content.substr(end + 2, bytes);
    at = end + 2 + bytes + 2;
  }
}

std::string Unzipped(const std::string& compressed) {
  z_stream stream{};
  if (inflateInit2(&stream, 15 + 16) != Z_OK) throw std::runtime_error("inflateInit2");
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(compressed.data()));
  stream.avail_in = static_cast<uInt>(compressed.size());
  std::string text;
  std::array<char, 4096> buffer;
  int status = Z_OK;
  while (status == Z_OK) {
    stream.next_out = reinterpret_cast<Bytef*>(buffer.data());
    stream.avail_out = static_cast<uInt>(buffer.size());
    status = inflate(&stream, Z_NO_FLUSH);
    text.append(buffer.data(), buffer.size() - stream.avail_out);
  }
  inflateEnd(&stream);
  if (status != Z_STREAM_END) throw std::runtime_error("the compressed text has no end");
  return text;
}

TEST(AnswerWriter, ALongAnswerGoesInChunksAndIsMadeAsItIsWritten) {
  int made = 0;
  AnswerWriter writer(Lines(100, &made), {});
  std::string part;
  ASSERT_TRUE(writer.Next(part));
  EXPECT_EQ(made, 1);
  ASSERT_TRUE(writer.Next(part));
  EXPECT_EQ(made, 2);
  EXPECT_FALSE(writer.IsDone());
}

TEST(AnswerWriter, LooksForContentOnceAtATimeAlsoWhereNothingIsFound) {
  int looks = 0;
  AnswerWriter writer(PiecesAnswer(
                          [&looks](std::string& piece) {
                            if (++looks < 100) return true;
                            piece = "found";
                            return false;
                          },
                          "text/plain"),
                      {});
  std::string part;
  for (int i = 1; i < 100; ++i) {
    ASSERT_TRUE(writer.Next(part));
    ASSERT_EQ(part, "");
    ASSERT_EQ(looks, i);
  }
  EXPECT_FALSE(writer.IsDone());
  ASSERT_TRUE(writer.Next(part));
  EXPECT_NE(part.find("Content-Length: 5\r\n"), std::string::npos);
  EXPECT_TRUE(writer.IsDone());
}

TEST(AnswerWriter, ChunksHoldTheWholeContent) {
  AnswerWriter writer(Lines(100), {});
  const Written written = Write(writer);
  EXPECT_NE(written.Header().find("Transfer-Encoding: chunked\r\n"), std::string::npos);
  EXPECT_EQ(written.Header().find("Content-Length"), std::string::npos);
  EXPECT_EQ(Unchunked(written.Content()), LinesText(100));
  EXPECT_TRUE(writer.keep_alive());
}

TEST(AnswerWriter, CompressedChunksHoldTheWholeContent) {
  AnswerForm form;
  form.gzip = true;
  AnswerWriter writer(Lines(500), form);
  const Written written = Write(writer);
  EXPECT_NE(written.Header().find("Content-Encoding: gzip\r\n"), std::string::npos);
  EXPECT_NE(written.Header().find("Vary: Accept-Encoding\r\n"), std::string::npos);
  EXPECT_EQ(Unzipped(Unchunked(written.Content())), LinesText(500));
}

TEST(AnswerWriter, ForHttp10TheEndOfTheConnectionEndsTheContent) {
  AnswerForm form;
  form.chunked = false;
  AnswerWriter writer(Lines(100), form);
  const Written written = Write(writer);
  EXPECT_EQ(written.Header().find("chunked"), std::string::npos);
  EXPECT_EQ(written.Content(), LinesText(100));
  EXPECT_FALSE(writer.keep_alive());
}

TEST(AnswerWriter, AShortAnswerHasALength) {
  AnswerWriter writer(Lines(1), {});
  const Written written = Write(writer);
  EXPECT_NE(written.Header().find("Content-Length: " + std::to_string(LinesText(1).size())),
            std::string::npos);
  EXPECT_EQ(written.Content(), LinesText(1));
}

TEST(AnswerWriter, KeptContentGoesInPartsWithItsLength) {
  HttpResponse answer;
  answer.content_type = "image/jpeg";
  answer.kept = std::make_shared<const std::vector<std::uint8_t>>(1 << 20, 'x');
  AnswerForm form;
  form.gzip = true;  // A JPEG is compressed already.
  AnswerWriter writer(std::move(answer), form);
  const Written written = Write(writer);
  EXPECT_NE(written.Header().find("Content-Length: 1048576\r\n"), std::string::npos);
  EXPECT_EQ(written.Header().find("gzip"), std::string::npos);
  EXPECT_EQ(written.Content().size(), 1U << 20);
  EXPECT_LE(written.largest_part, kPieceBytes + 1024);
}

TEST(AnswerWriter, KeptContentCountsAsHeldBecauseItsCacheMayLetGoOfIt) {
  HttpResponse answer;
  answer.content_type = "image/jpeg";
  answer.kept = std::make_shared<const std::vector<std::uint8_t>>(1 << 20, 'x');
  const AnswerWriter writer(std::move(answer), {});
  EXPECT_GE(writer.HeldBytes(), 1U << 20);
  EXPECT_LT(writer.HeldBytes(), 2U << 20);
}

TEST(AnswerWriter, AnAnswerToHeadIsItsHeader) {
  AnswerForm form;
  form.head_only = true;
  AnswerWriter writer(Lines(100), form);
  const Written written = Write(writer);
  EXPECT_EQ(written.Content(), "");
  EXPECT_NE(written.Header().find("Transfer-Encoding: chunked\r\n"), std::string::npos);
}

TEST(AnswerWriter, AFailureInTheMiddleIsNotTakenForTheEnd) {
  AnswerWriter writer(PiecesAnswer(
                          [first = true](std::string& piece) mutable {
                            if (!first) throw std::runtime_error("the store does not answer");
                            first = false;
                            piece = std::string(kPieceBytes, 'x');
                            return true;
                          },
                          "text/plain"),
                      {});
  std::string part;
  ASSERT_TRUE(writer.Next(part));
  EXPECT_GT(part.size(), kPieceBytes);
  EXPECT_EQ(part.find("0\r\n\r\n"), std::string::npos);
  EXPECT_THROW(writer.Next(part), std::runtime_error);
}

TEST(AnswerWriter, A304HasNoContentAndNoLength) {
  HttpResponse answer;
  answer.status = 304;
  answer.content_type = "text/css";
  AnswerWriter writer(std::move(answer), {});
  const Written written = Write(writer);
  EXPECT_EQ(written.Content(), "");
  EXPECT_EQ(written.Header().find("Content-"), std::string::npos);
}

TEST(AcceptsGzip, ReadsCodingsAndTheirWeights) {
  EXPECT_FALSE(AcceptsGzip(""));
  EXPECT_TRUE(AcceptsGzip("gzip"));
  EXPECT_TRUE(AcceptsGzip("br, GZIP;q=0.5"));
  EXPECT_TRUE(AcceptsGzip("x-gzip"));
  EXPECT_TRUE(AcceptsGzip("*"));
  EXPECT_FALSE(AcceptsGzip("*;q=0"));
  EXPECT_FALSE(AcceptsGzip("gzip;q=0.000, *"));
  EXPECT_FALSE(AcceptsGzip("br, deflate"));
  EXPECT_FALSE(AcceptsGzip("gzipped"));
}

}  // namespace
}  // namespace livemap::web
