#include "change/measures/change_pairs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "change/measures/change_predictions.h"
#include "common/error.h"
#include "protocol/change_class.h"
#include "test/support/oriented_jpeg.h"
#include "test/support/temporary_directory.h"

namespace livemap::change {
namespace {

using testing::AllOf;
using testing::HasSubstr;

template <typename Body>
std::string WhyRefused(const Body& body) {
  try {
    body();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

class ChangePairsTest : public testing::Test {
 protected:
  void Write(const std::string& path, const cv::Mat& image) const {
    const std::string whole = folder_.path() + "/" + path;
    std::filesystem::create_directories(std::filesystem::path(whole).parent_path());
    ASSERT_TRUE(cv::imwrite(whole, image));
  }
  static cv::Mat Picture(int width = 8, int height = 6, int grey = 100) {
    return {height, width, CV_8UC3, cv::Scalar::all(grey)};
  }
  /// A mask in colours, red green blue per pixel.
  static cv::Mat Colours(const std::vector<cv::Vec3b>& rgb) {
    cv::Mat mask(1, static_cast<int>(rgb.size()), CV_8UC3);
    for (int i = 0; i < mask.cols; ++i) {
      const cv::Vec3b& colour = rgb[static_cast<std::size_t>(i)];
      mask.at<cv::Vec3b>(0, i) = {colour[2], colour[1], colour[0]};
    }
    return mask;
  }
  void WriteSequencePair(const std::string& sequence, const std::string& number) const {
    Write(sequence + "/RGB/1_" + number + ".png", Picture(8, 6, 50));
    Write(sequence + "/RGB/2_" + number + ".png", Picture(8, 6, 150));
    Write(sequence + "/GT/gt" + number + ".png", cv::Mat::zeros(6, 8, CV_8UC1));
  }
  std::vector<std::string> Names(const std::string& inside = "") const {
    std::vector<std::string> names;
    for (const ChangePairFiles& files : FindChangePairs(folder_.path() + inside)) {
      names.push_back(files.name);
    }
    return names;
  }

  test::TemporaryDirectory folder_;
};

TEST_F(ChangePairsTest, ReadsAFolderAPairWithWhatIsIgnoredAndTheHomography) {
  for (const std::string name : {"004_027", "012_003"}) {
    Write(name + "/t0.jpg", Picture(8, 6, 50));
    Write(name + "/t1.jpg", Picture(8, 6, 150));
    cv::Mat mask = cv::Mat::zeros(6, 8, CV_8UC1);
    mask.at<std::uint8_t>(2, 3) = 255;
    Write(name + "/mask.png", mask);
    Write(name + "/t0_objects.png", mask);
  }
  cv::Mat ignored = cv::Mat::zeros(6, 8, CV_8UC1);
  ignored.row(0) = 255;
  Write("004_027/ignore.png", ignored);
  std::ofstream(folder_.path() + "/004_027/H_t1_to_t0.txt") << "1 0 5\n0 1 0\n0 0 1e0\n";
  std::ofstream(folder_.path() + "/README.md") << "notes";
  EXPECT_THAT(Names(), testing::ElementsAre("004_027", "012_003"));
  const std::vector<ChangePairFiles> files = FindChangePairs(folder_.path());
  const ChangePair pair = LoadChangePair(files[0]);
  EXPECT_NEAR(pair.before.at<cv::Vec3b>(0, 0)[0], 150, 2) << "the truth is in the view of t0";
  EXPECT_NEAR(pair.after.at<cv::Vec3b>(0, 0)[0], 50, 2);
  EXPECT_FALSE(pair.with_classes);
  EXPECT_EQ(pair.truth.at<std::uint8_t>(2, 3), 1);
  EXPECT_EQ(pair.truth.at<std::uint8_t>(0, 3), kLeftOutPixel);
  ASSERT_TRUE(pair.after_from_before.has_value());
  EXPECT_EQ((*pair.after_from_before)(0, 2), 5);
  const ChangePair plain = LoadChangePair(files[1]);
  EXPECT_EQ(plain.truth.at<std::uint8_t>(0, 3), 0);
  EXPECT_FALSE(plain.after_from_before.has_value());
  for (const std::string text : {"1 0 5 0 1 0 0 0", "1 0 5 0 1 0 0 0 one", "0 0 0 0 0 0 0 0 0"}) {
    std::ofstream(folder_.path() + "/004_027/H_t1_to_t0.txt") << text;
    EXPECT_THAT(WhyRefused([&] { LoadChangePair(files[0]); }),
                AllOf(HasSubstr("H_t1_to_t0.txt"), HasSubstr("nine numbers")));
  }
}

TEST_F(ChangePairsTest, FindsThePublishedLayoutFromEveryFolderOfIt) {
  WriteSequencePair("raw/001", "00");
  WriteSequencePair("raw/000", "10");
  WriteSequencePair("raw/000", "02");
  // What the data set and ours hold besides.
  Write("raw/000/GT_colours/gt02.png", Picture());
  Write("raw/000/GT/mask02.png", Picture());
  std::filesystem::create_directories(folder_.path() + "/raw/notes");
  EXPECT_THAT(Names(), testing::ElementsAre("000/02", "000/10", "001/00"));
  EXPECT_THAT(Names("/raw"), testing::ElementsAre("000/02", "000/10", "001/00"));
  EXPECT_THAT(Names("/raw/000"), testing::ElementsAre("02", "10"));
  const ChangePair pair = LoadChangePair(FindChangePairs(folder_.path())[0]);
  EXPECT_EQ(pair.before.at<cv::Vec3b>(0, 0)[0], 50);
  EXPECT_EQ(pair.after.at<cv::Vec3b>(0, 0)[0], 150);
  EXPECT_TRUE(pair.with_classes);
}

TEST_F(ChangePairsTest, ReadsTheMaskOfDirectionsWhereThereIsOne) {
  WriteSequencePair("raw/000", "00");
  EXPECT_TRUE(LoadChangePair(FindChangePairs(folder_.path())[0]).direction.empty());
  cv::Mat direction = LoadChangePair(FindChangePairs(folder_.path())[0]).truth * 0;
  direction.at<std::uint8_t>(1, 2) = protocol::kVanishedPixel;
  Write("raw/000/GT_direction/gt00.png", direction);
  const ChangePair pair = LoadChangePair(FindChangePairs(folder_.path())[0]);
  EXPECT_EQ(cv::countNonZero(pair.direction != direction), 0);
  direction.at<std::uint8_t>(1, 2) = 3;
  Write("raw/000/GT_direction/gt00.png", direction);
  EXPECT_THROW(LoadChangePair(FindChangePairs(folder_.path())[0]), Error);
}

TEST_F(ChangePairsTest, OfSeveralDataSetsAreNamedByTheWayToThem) {
  WriteSequencePair("7/some/raw/000", "00");
  WriteSequencePair("7/all/raw/000", "00");
  WriteSequencePair("8/some/raw/000", "00");
  const auto names_of = [this](const std::vector<std::string>& sets) {
    std::vector<std::string> folders;
    for (const std::string& set : sets) folders.push_back(folder_.path() + set);
    std::vector<std::string> names;
    for (const ChangePairFiles& files : FindChangePairs(folders)) names.push_back(files.name);
    return names;
  };
  EXPECT_THAT(names_of({"/7/some", "/8/some/", "/7/all"}),
              testing::ElementsAre("7/some/000/00", "8/some/000/00", "7/all/000/00"));
  EXPECT_THAT(names_of({"/7/some", "/7/all"}), testing::ElementsAre("some/000/00", "all/000/00"));
  EXPECT_THAT(names_of({"/7/some"}), testing::ElementsAre("000/00"));
  EXPECT_THROW(names_of({"/7/some", "/8/some", "/7/some/"}), Error);
}

TEST_F(ChangePairsTest, FindsTheFlatLayout) {
  for (const std::string name : {"1_00_0", "1_01_0"}) {
    Write("t0/" + name + ".png", Picture(8, 6, 50));
    Write("t1/" + name + ".jpg", Picture(8, 6, 150));
    cv::Mat mask = cv::Mat::zeros(6, 8, CV_8UC1);
    mask.at<std::uint8_t>(2, 3) = 255;
    Write("mask/" + name + ".png", mask);
  }
  EXPECT_THAT(Names(), testing::ElementsAre("1_00_0", "1_01_0"));
  const ChangePair pair = LoadChangePair(FindChangePairs(folder_.path())[0]);
  EXPECT_FALSE(pair.with_classes);
  EXPECT_EQ(cv::countNonZero(pair.truth), 1);
  EXPECT_EQ(pair.truth.at<std::uint8_t>(2, 3), 1);
  EXPECT_NEAR(pair.after.at<cv::Vec3b>(0, 0)[0], 150, 2);
}

TEST_F(ChangePairsTest, RefusesFoldersWithoutPairs) {
  EXPECT_THAT(WhyRefused([&] { FindChangePairs(folder_.path()); }),
              AllOf(HasSubstr(folder_.path()), HasSubstr("0 pairs"), HasSubstr("raw/NNN/RGB")));
  EXPECT_THAT(WhyRefused([&] { FindChangePairs("/nowhere"); }), HasSubstr("/nowhere"));
  WriteSequencePair("raw/000", "00");
  std::filesystem::remove(folder_.path() + "/raw/000/RGB/1_00.png");
  EXPECT_THAT(WhyRefused([&] { FindChangePairs(folder_.path()); }), HasSubstr("1_00"));
}

TEST_F(ChangePairsTest, RefusesPicturesOfOtherSizesAndBrokenOnes) {
  WriteSequencePair("raw/000", "00");
  const auto why = [&] {
    return WhyRefused([&] { LoadChangePair(FindChangePairs(folder_.path())[0]); });
  };
  EXPECT_EQ(why(), "");
  Write("raw/000/RGB/1_00.png", Picture(9, 6));
  EXPECT_THAT(why(), AllOf(HasSubstr("1_00.png"), HasSubstr("9x6"), HasSubstr("8x6")));
  WriteSequencePair("raw/000", "00");
  Write("raw/000/GT/gt00.png", cv::Mat::zeros(5, 8, CV_8UC1));
  EXPECT_THAT(why(), AllOf(HasSubstr("gt00.png"), HasSubstr("8x5")));
  WriteSequencePair("raw/000", "00");
  const std::string picture = folder_.path() + "/raw/000/RGB/2_00.png";
  std::filesystem::resize_file(picture, std::filesystem::file_size(picture) - 20);
  EXPECT_THAT(why(), AllOf(HasSubstr("2_00.png"), HasSubstr("cut off")));
  std::ofstream(picture) << "no picture";
  EXPECT_THAT(why(), HasSubstr("no JPEG or PNG"));
}

TEST_F(ChangePairsTest, ReadsThePublishedColours) {
  std::vector<cv::Vec3b> rgb;
  for (int i = 0; i < protocol::kChangeClasses; ++i) {
    const auto colour = protocol::ChangeClassColour(static_cast<protocol::ChangeClass>(i));
    rgb.emplace_back(colour[0], colour[1], colour[2]);
  }
  rgb.emplace_back(255, 242, 0);  // Miscellaneous, which is rubbish.
  rgb.emplace_back(0, 0, 0);
  const ChangeMask mask = DecodeChangeMask(Colours(rgb), "gt.png");
  for (int i = 0; i < protocol::kChangeClasses; ++i)
    EXPECT_EQ(mask.classes.at<std::uint8_t>(0, i), i);
  EXPECT_EQ(mask.classes.at<std::uint8_t>(0, 10),
            static_cast<int>(protocol::ChangeClass::kRubbish));
  EXPECT_EQ(mask.classes.at<std::uint8_t>(0, 11), kLeftOutPixel);
  EXPECT_EQ(mask.unknown_colour_pixels, 0U);
}

TEST_F(ChangePairsTest, LeavesOutAFewUnknownColoursAndRefusesMany) {
  std::vector<cv::Vec3b> rgb(200, {255, 255, 255});
  rgb[7] = {250, 20, 30};
  const ChangeMask mask = DecodeChangeMask(Colours(rgb), "gt.png");
  EXPECT_EQ(mask.unknown_colour_pixels, 1U);
  EXPECT_EQ(mask.classes.at<std::uint8_t>(0, 7), kLeftOutPixel);
  rgb[8] = rgb[9] = rgb[7];
  EXPECT_THAT(WhyRefused([&] { DecodeChangeMask(Colours(rgb), "gt.png"); }),
              AllOf(HasSubstr("gt.png"), HasSubstr("3 of 200")));
}

TEST_F(ChangePairsTest, TellsIndicesFromTwoValues) {
  const auto decode = [](const std::vector<std::uint8_t>& values) {
    return DecodeChangeMask(cv::Mat(values, true).reshape(1, 1), "m.png");
  };
  EXPECT_TRUE(decode({0, 9, 255}).with_classes);
  EXPECT_EQ(decode({0, 9, 255}).classes.at<std::uint8_t>(0, 2), kLeftOutPixel);
  EXPECT_FALSE(decode({0, 255, 255}).with_classes);
  EXPECT_EQ(decode({0, 255, 255}).classes.at<std::uint8_t>(0, 2), 1);
  EXPECT_THAT(WhyRefused([&] { decode({0, 128}); }), AllOf(HasSubstr("m.png"), HasSubstr("128")));
  EXPECT_THAT(WhyRefused([&] { DecodeChangeMask(cv::Mat::zeros(1, 1, CV_16UC1), "m.png"); }),
              HasSubstr("16 bits"));
}

TEST_F(ChangePairsTest, RefusesGreyMasksInThreeChannelsUnlessANeighbourHasColours) {
  WriteSequencePair("raw/000", "00");
  cv::Mat mask(6, 8, CV_8UC3, cv::Scalar(0, 0, 0));
  mask.at<cv::Vec3b>(2, 3) = {255, 255, 255};
  const auto why = [&] {
    return WhyRefused([&] { LoadChangePair(FindChangePairs(folder_.path())[0]); });
  };
  const cv::Mat black(6, 8, CV_8UC3, cv::Scalar(0, 0, 0));
  const cv::Mat indices(6, 8, CV_8UC3, cv::Scalar(3, 3, 3));
  for (const cv::Mat& ambiguous : {mask, black, indices}) {
    Write("raw/000/GT/gt00.png", ambiguous);
    EXPECT_THAT(why(), AllOf(HasSubstr("gt00.png"), HasSubstr("8 bits, three channels"),
                             HasSubstr("accepted are one channel")));
  }
  Write("raw/000/GT/gt00.png", cv::Mat(6, 8, CV_8UC3, cv::Scalar(255, 255, 255)));
  EXPECT_EQ(why(), "") << "no change, as every published mask of an unchanged street is";
  Write("raw/000/GT/gt00.png", mask);
  WriteSequencePair("raw/000", "01");
  Write("raw/000/GT/gt01.png", cv::Mat(6, 8, CV_8UC3, cv::Scalar(29, 230, 181)));
  const ChangePair pair = LoadChangePair(FindChangePairs(folder_.path())[0]);
  EXPECT_EQ(cv::countNonZero(pair.truth == int{kLeftOutPixel}), 47);
  EXPECT_EQ(pair.truth.at<std::uint8_t>(2, 3), 0);
}

TEST_F(ChangePairsTest, ReadsZeroAnd255AsLeftOutWhereANeighbourHasClassesAndAsChangeElsewhere) {
  cv::Mat mask = cv::Mat::zeros(6, 8, CV_8UC1);
  mask.at<std::uint8_t>(2, 3) = 255;
  for (const char* number : {"00", "01"}) {
    WriteSequencePair("raw/000", number);
    Write(std::string("raw/000/GT/gt") + number + ".png", mask);
  }
  EXPECT_EQ(cv::countNonZero(LoadChangePair(FindChangePairs(folder_.path())[0]).truth == 1), 1);
  Write("raw/000/GT/gt01.png", cv::Mat(6, 8, CV_8UC1, cv::Scalar(7)));
  const ChangePair pair = LoadChangePair(FindChangePairs(folder_.path())[0]);
  EXPECT_TRUE(pair.with_classes);
  EXPECT_EQ(pair.truth.at<std::uint8_t>(2, 3), kLeftOutPixel) << "a street without a change";
  EXPECT_EQ(cv::countNonZero(pair.truth), 1);
}

TEST_F(ChangePairsTest, RefusesMasksWithTransparencyAndMasksThatNothingIsLeftOf) {
  cv::Mat transparent(1, 200, CV_8UC4, cv::Scalar(255, 255, 255, 255));
  transparent.at<cv::Vec4b>(0, 0)[3] = 0;
  EXPECT_THAT(WhyRefused([&] { DecodeChangeMask(transparent, "gt.png"); }),
              AllOf(HasSubstr("gt.png"), HasSubstr("transparent")));
  std::vector<cv::Vec3b> rgb(200, {0, 0, 0});
  rgb[7] = {128, 0, 0};  // Of a palette of another data set.
  EXPECT_THAT(WhyRefused([&] { DecodeChangeMask(Colours(rgb), "gt.png"); }),
              AllOf(HasSubstr("1 of 200"), HasSubstr("the others are black")));
}

TEST_F(ChangePairsTest, ReadsAJpegMaskOfTwoValuesAndRefusesOthers) {
  Write("t0/a.png", Picture(64, 64));
  Write("t1/a.png", Picture(64, 64));
  cv::Mat mask = cv::Mat::zeros(64, 64, CV_8UC1);
  mask(cv::Rect(16, 16, 32, 32)) = 255;
  Write("mask/a.jpg", mask);
  const ChangePair pair = LoadChangePair(FindChangePairs(folder_.path())[0]);
  EXPECT_FALSE(pair.with_classes);
  EXPECT_NEAR(cv::countNonZero(pair.truth == 1), 32 * 32, 64);
  mask(cv::Rect(16, 16, 32, 32)) = 5;
  Write("mask/a.jpg", mask);
  EXPECT_THAT(WhyRefused([&] { LoadChangePair(FindChangePairs(folder_.path())[0]); }),
              AllOf(HasSubstr("a.jpg"), HasSubstr("JPEG"), HasSubstr("PNG")));
}

TEST_F(ChangePairsTest, ValuesThatAJpegsLossesMadeAreNoClasses) {
  for (const std::string name : {"a", "b"}) {
    Write("t0/" + name + ".png", Picture(64, 64));
    Write("t1/" + name + ".png", Picture(64, 64));
    cv::Mat mask = cv::Mat::zeros(64, 64, CV_8UC1);
    mask(cv::Rect(13, 11, 31, 29)) = 255;
    Write("mask/" + name + ".jpg", mask);
    const cv::Mat lossy = ReadPicture(folder_.path() + "/mask/" + name + ".jpg",
                                      imaging::DecodeConfig::Pixels::kAsStored);
    ASSERT_GT(cv::countNonZero((lossy >= 1) & (lossy <= 9)), 0) << "else this tests nothing";
  }
  for (const ChangePairFiles& files : FindChangePairs(folder_.path())) {
    const ChangePair pair = LoadChangePair(files);
    EXPECT_FALSE(pair.with_classes);
    EXPECT_EQ(cv::countNonZero(pair.truth == int{kLeftOutPixel}), 0);
    EXPECT_EQ(cv::countNonZero(pair.truth == 1), 31 * 29);
  }
}

TEST_F(ChangePairsTest, PairsPicturesByTheirNumberHoweverItIsWritten) {
  for (const int number : {0, 2, 10}) {
    const std::string text = std::to_string(number);
    Write("raw/000/RGB/1_0" + text + ".PNG", Picture(8, 6, 50));
    Write("raw/000/RGB/2_" + text + ".jpeg", Picture(8, 6, 150));
    Write("raw/000/GT/gt" + text + ".png", cv::Mat::zeros(6, 8, CV_8UC1));
  }
  EXPECT_THAT(Names(), testing::ElementsAre("000/0", "000/2", "000/10"));
  EXPECT_THAT(FindChangePairs(folder_.path())[2].before, HasSubstr("1_010.PNG"));
  Write("raw/000/GT/gt002.png", cv::Mat::zeros(6, 8, CV_8UC1));
  EXPECT_THAT(WhyRefused([&] { FindChangePairs(folder_.path()); }),
              AllOf(HasSubstr("gt2.png"), HasSubstr("gt002.png")));
}

TEST_F(ChangePairsTest, TurnsPicturesAsTheirExifSays) {
  Write("mask/a.png", cv::Mat::zeros(8, 6, CV_8UC1));
  Write("t1/a.png", Picture(6, 8));
  std::filesystem::create_directories(folder_.path() + "/t0");
  const std::vector<std::uint8_t> file = test::OrientedJpeg(Picture(8, 6), 6);
  std::ofstream(folder_.path() + "/t0/a.jpg", std::ios::binary)
      .write(reinterpret_cast<const char*>(file.data()), static_cast<std::streamsize>(file.size()));
  EXPECT_EQ(LoadChangePair(FindChangePairs(folder_.path())[0]).before.size(), cv::Size(6, 8));
}

std::string Npy(const std::string& type, const std::string& order, const std::string& shape,
                const std::string& data) {
  std::string header =
      "{'descr': '" + type + "', 'fortran_order': " + order + ", 'shape': " + shape + ", }";
  header += std::string(63 - (10 + header.size()) % 64, ' ') + "\n";
  std::string bytes("\x93NUMPY\x01\x00", 8);
  bytes += static_cast<char>(header.size() & 0xff);
  bytes += static_cast<char>(header.size() >> 8U);
  return bytes + header + data;
}

TEST_F(ChangePairsTest, ReadsNumpysArrays) {
  std::string data;
  for (int i = 0; i < 10 * 2 * 3; ++i) {
    const float value = static_cast<float>(i) / 100;
    data.append(reinterpret_cast<const char*>(&value), sizeof(value));
  }
  const auto floats = ParseNpyProbabilities(Npy("<f4", "False", "(10, 2, 3)", data), "p.npy");
  ASSERT_TRUE(floats.tells_classes());
  EXPECT_EQ(floats.of_class[0].size(), cv::Size(3, 2));
  EXPECT_FLOAT_EQ(floats.of_class[9].at<float>(1, 2), 0.59F);
  const auto bytes =
      ParseNpyProbabilities(Npy("|u1", "False", "(10, 1, 2)", std::string(20, '\xff')), "p.npy");
  EXPECT_FLOAT_EQ(bytes.of_class[3].at<float>(0, 1), 1.0F);
}

TEST_F(ChangePairsTest, RefusesArraysThatAreNoPrediction) {
  const std::string data(10 * 2 * 3 * 4, '\0');
  const auto why = [](const std::string& bytes) {
    return WhyRefused([&] { ParseNpyProbabilities(bytes, "p.npy"); });
  };
  EXPECT_EQ(why(Npy("<f4", "False", "(10, 2, 3)", data)), "");
  for (const std::string& bytes :
       {std::string("abc"), Npy("<f8", "False", "(10, 2, 3)", data),
        Npy("<f4", "True", "(10, 2, 3)", data), Npy("<f4", "False", "(9, 2, 3)", data),
        Npy("<f4", "False", "(10, 2)", data), Npy("<f4", "False", "(10, 2, 4)", data),
        Npy("<f4", "False", "(10, 99999999, 99999999)", data),
        Npy("<f4", "False", "(10, 2, 3", data), Npy("<f4", "False", "(10, -2, 3)", data),
        Npy("<f4", "False", "(10, 2, 3)", data).substr(0, 40)}) {
    EXPECT_THAT(why(bytes), AllOf(HasSubstr("p.npy"), HasSubstr("accepted")));
  }
}

TEST_F(ChangePairsTest, PredictionsAreFoundByThePairsName) {
  Write("predictions/000/00.png", cv::Mat(6, 8, CV_8UC1, cv::Scalar(51)));
  const std::string folder = folder_.path() + "/predictions";
  const auto scores = ReadPrediction(folder, "000/00", {8, 6});
  EXPECT_FALSE(scores.tells_classes());
  EXPECT_FLOAT_EQ(scores.of_class[1].at<float>(0, 0), 0.2F);
  EXPECT_THAT(WhyRefused([&] {
                ReadPrediction(folder, "000/00", {8, 7});
              }),
              AllOf(HasSubstr("8x6"), HasSubstr("8x7")));
  EXPECT_THAT(WhyRefused([&] {
                ReadPrediction(folder, "000/01", {8, 6});
              }),
              AllOf(HasSubstr("000/01"), HasSubstr("missing")));
  Write("predictions/000/02.png", cv::Mat::eye(6, 8, CV_8UC1));
  EXPECT_THAT(WhyRefused([&] {
                ReadPrediction(folder, "000/02", {8, 6});
              }),
              AllOf(HasSubstr("000/02.png"), HasSubstr("may be classes")));
  Write("predictions/000/03.png", cv::Mat(6, 8, CV_8UC1, cv::Scalar(9)));
  EXPECT_THAT(WhyRefused([&] {
                ReadPrediction(folder, "000/03", {8, 6});
              }),
              AllOf(HasSubstr("000/03.png"), HasSubstr("0 to 9"), HasSubstr("may be classes")));
  Write("predictions/000/04.png", cv::Mat(6, 8, CV_8UC1, cv::Scalar(51)));
  std::filesystem::rename(folder + "/000/04.png", folder + "/000/04.PNG");
  EXPECT_FLOAT_EQ(ReadPrediction(folder, "000/04", {8, 6}).of_class[1].at<float>(0, 0), 0.2F);
  WriteScorePicture(folder + "/001/00.png", scores);
  EXPECT_NEAR(ReadPrediction(folder, "001/00", {8, 6}).of_class[1].at<float>(5, 7), 0.2F, 1e-5F);
}

}  // namespace
}  // namespace livemap::change
