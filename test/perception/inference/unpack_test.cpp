#include "perception/inference/unpack.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <string>

#include "common/error.h"

namespace livemap::perception {
namespace {

constexpr std::size_t kMost = 5'000'000;

std::string Gzip(const std::string& bytes) {
  z_stream stream{};
  EXPECT_EQ(deflateInit2(&stream, 9, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY), Z_OK);
  std::string packed(deflateBound(&stream, bytes.size()) + 32, '\0');
  std::string input = bytes;
  stream.next_in = reinterpret_cast<Bytef*>(input.data());
  stream.avail_in = static_cast<uInt>(input.size());
  stream.next_out = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_out = static_cast<uInt>(packed.size());
  EXPECT_EQ(deflate(&stream, Z_FINISH), Z_STREAM_END);
  packed.resize(stream.total_out);
  deflateEnd(&stream);
  return packed;
}

std::string Numbers(std::size_t count) {
  std::string bytes;
  for (std::size_t i = 0; bytes.size() < count; ++i) bytes += std::to_string(i * i);
  bytes.resize(count);
  return bytes;
}

TEST(Unpacked, GivesBackWhatWasPackedAndWhatIsNotPackedAsItIs) {
  for (const std::size_t size : {std::size_t{0}, std::size_t{1}, std::size_t{3'000'000}, kMost}) {
    EXPECT_EQ(Unpacked(Gzip(Numbers(size)), "m.gz", kMost), Numbers(size)) << size;
  }
  EXPECT_EQ(Unpacked("not packed", "m", kMost), "not packed");
  EXPECT_EQ(Unpacked("", "m", kMost), "");
}

TEST(Unpacked, RefusesWhatHoldsMoreThanIsAccepted) {
  EXPECT_THROW(Unpacked(Gzip(Numbers(kMost + 1)), "m.gz", kMost), Error);
  const std::string bomb = Gzip(std::string(50'000'000, '\0'));
  ASSERT_LT(bomb.size(), 100'000U);
  EXPECT_THROW(Unpacked(bomb, "m.gz", kMost), Error);
}

TEST(Unpacked, RefusesADamagedFileByItsName) {
  const std::string whole = Gzip(Numbers(10'000));
  std::string flipped = whole;
  flipped[whole.size() / 2] = static_cast<char>(flipped[whole.size() / 2] ^ 1);
  for (const std::string& damaged :
       {whole.substr(0, whole.size() - 1), whole.substr(0, 3), whole + "x", flipped}) {
    try {
      Unpacked(damaged, "models/m.gz", kMost);
      ADD_FAILURE() << "accepted a damaged file of " << damaged.size() << " bytes";
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find("'models/m.gz'"), std::string::npos);
    }
  }
}

}  // namespace
}  // namespace livemap::perception
