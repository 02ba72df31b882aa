#include "imaging/video_orientation.h"

#include <gmock/gmock.h>

#include <fstream>
#include <string>

#include "imaging/orientation.h"
#include "test/support/temporary_directory.h"

namespace livemap::imaging {
namespace {

std::string Number(std::int32_t value) {
  std::string bytes;
  for (const int shift : {24, 16, 8, 0}) {
    bytes += static_cast<char>(static_cast<std::uint32_t>(value) >> shift & 0xffU);
  }
  return bytes;
}

std::string MovieBox(const std::string& type, const std::string& content) {
  return Number(static_cast<std::int32_t>(content.size()) + 8) + type + content;
}

std::string Track(const std::string& handler, const std::vector<std::int32_t>& abcd,
                  bool long_times = false) {
  std::string header(long_times ? 52 : 40, '\0');
  header[0] = long_times ? '\1' : '\0';
  const std::vector<std::int32_t> matrix = {abcd[0], abcd[1], 0, abcd[2], abcd[3], 0, 0, 0, 1};
  for (const std::int32_t value : matrix) header += Number(value * 65536);
  return MovieBox("trak", MovieBox("tkhd", header + std::string(8, '\0')) +
                              MovieBox("mdia", MovieBox("mdhd", std::string(24, '\0')) +
                                                   MovieBox("hdlr", std::string(8, '\0') + handler +
                                                                        std::string(12, '\0'))));
}

int OrientationOf(const std::string& movie) {
  return OrientationOfMovie({movie.begin(), movie.end()});
}

TEST(VideoOrientation, IsThatOfTheMatrixOfTheFirstVideoTrack) {
  EXPECT_EQ(OrientationOf(Track("vide", {1, 0, 0, 1})), 1);
  EXPECT_EQ(OrientationOf(Track("vide", {-1, 0, 0, -1})), 3);
  EXPECT_EQ(OrientationOf(Track("vide", {0, 1, -1, 0})), 6);
  EXPECT_EQ(OrientationOf(Track("vide", {0, -1, 1, 0})), 8);
  EXPECT_EQ(OrientationOf(Track("vide", {-1, 0, 0, 1}, true)), 2);
  EXPECT_EQ(OrientationOf(MovieBox("mvhd", std::string(100, '\0')) + Track("soun", {0, -1, 1, 0}) +
                          Track("vide", {0, 1, -1, 0}) + Track("vide", {1, 0, 0, 1})),
            6);
}

TEST(VideoOrientation, IsUprightForAnythingElse) {
  EXPECT_EQ(OrientationOf(""), kUpright);
  EXPECT_EQ(OrientationOf(Track("vide", {2, 1, 0, 0})), kUpright) << "no quarter turn";
  EXPECT_EQ(OrientationOf(Track("soun", {0, 1, -1, 0})), kUpright);
  const std::string whole = Track("vide", {0, 1, -1, 0});
  for (std::size_t size = 0; size < whole.size(); ++size) {
    EXPECT_EQ(OrientationOf(whole.substr(0, size)), kUpright);
  }
}

TEST(VideoOrientation, IsFoundBehindTheFramesAndInLongBoxes) {
  const test::TemporaryDirectory folder;
  const std::string path = folder.path() + "/a.mp4";
  const std::string movie = MovieBox("moov", Track("vide", {0, 1, -1, 0}));
  const std::string frames = Number(1) + "mdat" + Number(0) + Number(116) + std::string(100, 'x');
  std::ofstream(path, std::ios::binary) << MovieBox("ftyp", "isom") << frames << movie;
  EXPECT_EQ(ReadVideoOrientation(path), 6);
  std::ofstream(path, std::ios::binary) << "RIFF....AVI " << movie;
  EXPECT_EQ(ReadVideoOrientation(path), kUpright);
  std::ofstream(path, std::ios::binary)
      << MovieBox("ftyp", "isom") << Number(1) << "mdat" << Number(-1) << Number(-1);
  EXPECT_EQ(ReadVideoOrientation(path), kUpright) << "a box that says it never ends";
  EXPECT_EQ(ReadVideoOrientation(path + "x"), kUpright);
}

}  // namespace
}  // namespace livemap::imaging
