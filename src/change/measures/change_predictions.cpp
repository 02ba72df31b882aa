#include "change/measures/change_predictions.h"

#include <array>
#include <cstring>
#include <filesystem>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <optional>

#include "change/measures/change_pairs.h"
#include "common/error.h"
#include "common/picture_folder.h"
#include "common/text.h"

namespace livemap::change {
namespace {

constexpr std::size_t kMaxNpyBytes = std::size_t{1} << 30U;
constexpr std::uint64_t kMaxSide = 16384;

[[noreturn]] void RefusePredictionNpy(const std::string& path, const std::string& why) {
  throw Error("prediction '" + path + "' " + why + ", accepted is a numpy array of " +
              std::to_string(protocol::kChangeClasses) +
              " x height x width in C order, float32 or uint8 in little endian");
}

struct NpyHeader {
  std::size_t data_at = 0;
  bool floats = false;
  std::array<std::uint64_t, 3> shape{};
};

/// What follows `'key':` in the header's Python dictionary, blanks aside; none when it is missing.
std::optional<std::size_t> PredictionNpyValue(const std::string& text, const std::string& key) {
  const std::size_t at = text.find("'" + key + "'");
  if (at == std::string::npos) return std::nullopt;
  const std::size_t colon = text.find_first_not_of(' ', at + key.size() + 2);
  if (colon == std::string::npos || text[colon] != ':') return std::nullopt;
  const std::size_t value = text.find_first_not_of(' ', colon + 1);
  if (value == std::string::npos) return std::nullopt;
  return value;
}

/// Three whole numbers in parentheses at `at`.
std::optional<std::array<std::uint64_t, 3>> ReadPredictionShape(const std::string& text,
                                                                std::size_t at) {
  if (at >= text.size() || text[at] != '(') return std::nullopt;
  std::array<std::uint64_t, 3> shape{};
  std::size_t i = at + 1;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    while (i < text.size() && text[i] == ' ') ++i;
    std::size_t digits = 0;
    for (; i < text.size() && text[i] >= '0' && text[i] <= '9' && digits < 9; ++i, ++digits) {
      shape[axis] = shape[axis] * 10 + static_cast<std::uint64_t>(text[i] - '0');
    }
    if (digits == 0 || i >= text.size()) return std::nullopt;
    if (text[i] == ',') {
      ++i;
      if (axis == 2) {
        while (i < text.size() && text[i] == ' ') ++i;
      }
    } else if (axis < 2) {
      return std::nullopt;
    }
  }
  if (i >= text.size() || text[i] != ')') return std::nullopt;
  return shape;
}

NpyHeader ReadPredictionNpyHeader(const std::string& bytes, const std::string& path) {
  if (bytes.size() < 12 || bytes.compare(0, 6, "\x93NUMPY") != 0)
    RefusePredictionNpy(path, "is no .npy");
  const auto byte = [&](std::size_t i) {
    return std::size_t{static_cast<unsigned char>(bytes[i])};
  };
  std::size_t length = byte(8) | byte(9) << 8U;
  std::size_t begin = 10;
  if (byte(6) != 1) {
    length |= byte(10) << 16U | byte(11) << 24U;
    begin = 12;
  }
  if (length > bytes.size() - begin) RefusePredictionNpy(path, "is cut off");
  const std::string text = bytes.substr(begin, length);
  const auto type = PredictionNpyValue(text, "descr");
  const auto order = PredictionNpyValue(text, "fortran_order");
  const auto shape_at = PredictionNpyValue(text, "shape");
  if (!type || !order || !shape_at) RefusePredictionNpy(path, "has a header that cannot be read");
  NpyHeader header;
  header.floats = text.compare(*type, 5, "'<f4'") == 0;
  if (!header.floats && text.compare(*type, 5, "'|u1'") != 0)
    RefusePredictionNpy(path, "has another type");
  if (text.compare(*order, 5, "False") != 0) RefusePredictionNpy(path, "is in Fortran's order");
  const auto shape = ReadPredictionShape(text, *shape_at);
  if (!shape || (*shape)[0] != protocol::kChangeClasses || (*shape)[1] < 1 ||
      (*shape)[1] > kMaxSide || (*shape)[2] < 1 || (*shape)[2] > kMaxSide) {
    RefusePredictionNpy(path, "has another shape");
  }
  header.shape = *shape;
  header.data_at = begin + length;
  return header;
}

/// What rounding to 255ths of ten classes may cost, and some.
constexpr double kMaxSumError = 0.05;

void CheckPredictionsSumToOne(const ChangeProbabilities& probabilities, const std::string& path) {
  cv::Mat sum = probabilities.of_class.at(0).clone();
  for (std::size_t i = 1; i < protocol::kChangeClasses; ++i) sum += probabilities.of_class[i];
  double least = 0;
  double most = 0;
  cv::minMaxLoc(sum, &least, &most);
  if (least < 1 - kMaxSumError || most > 1 + kMaxSumError) {
    throw Error("prediction '" + path + "' holds probabilities of which those of a pixel sum to " +
                std::to_string(least) + " to " + std::to_string(most) + ", accepted is 1");
  }
}

/// The file at `stem` with that extension in any spelling, .npy or .NPY; none where there is none.
std::optional<std::string> FindPrediction(const std::filesystem::path& stem,
                                          const std::string& extension) {
  const std::string exact = stem.string() + extension;
  std::error_code ignored;
  if (std::filesystem::is_regular_file(exact, ignored)) return exact;
  for (const auto& entry : std::filesystem::directory_iterator(stem.parent_path(), ignored)) {
    const std::string path = entry.path().string();
    if (StemOf(path) == stem.filename() && LowerExtension(path) == extension &&
        entry.is_regular_file(ignored))
      return path;
  }
  return std::nullopt;
}

ChangeProbabilities PredictionFromScore(const cv::Mat& score) {
  ChangeProbabilities probabilities;
  probabilities.of_class.resize(2);
  probabilities.of_class[1] = score;
  cv::subtract(1.0, score, probabilities.of_class[0]);
  return probabilities;
}

void WritePredictionPicture(const std::string& path, const cv::Mat& image) {
  std::error_code error;
  std::filesystem::create_directories(std::filesystem::path(path).parent_path(), error);
  bool written = false;
  try {
    written = cv::imwrite(path, image);
  } catch (const cv::Exception&) {
  }
  if (!written) throw Error("picture '" + path + "' cannot be written");
}

}  // namespace

ChangeProbabilities ParseNpyProbabilities(const std::string& bytes, const std::string& path) {
  const NpyHeader header = ReadPredictionNpyHeader(bytes, path);
  const std::size_t pixels = header.shape[1] * header.shape[2];
  const std::size_t wanted = protocol::kChangeClasses * pixels * (header.floats ? 4 : 1);
  if (bytes.size() - header.data_at != wanted) {
    RefusePredictionNpy(path, "has " + std::to_string(bytes.size() - header.data_at) +
                                  " bytes of data where its shape wants " + std::to_string(wanted));
  }
  ChangeProbabilities probabilities;
  const char* data = bytes.data() + header.data_at;
  for (std::size_t i = 0; i < protocol::kChangeClasses; ++i) {
    cv::Mat image(static_cast<int>(header.shape[1]), static_cast<int>(header.shape[2]),
                  header.floats ? CV_32FC1 : CV_8UC1);
    const std::size_t size = pixels * image.elemSize();
    std::memcpy(image.data, data + i * size, size);
    if (!header.floats) image.convertTo(image, CV_32FC1, 1.0 / 255);
    probabilities.of_class.push_back(image);
  }
  return probabilities;
}

ChangeProbabilities ReadPrediction(const std::string& folder, const std::string& name,
                                   cv::Size size) {
  const std::filesystem::path stem = std::filesystem::path(folder) / name;
  ChangeProbabilities probabilities;
  std::string path;
  if (const auto npy = FindPrediction(stem, ".npy")) {
    path = *npy;
    probabilities = ParseNpyProbabilities(ReadFile(path, kMaxNpyBytes), path);
  } else {
    const auto picture = FindPrediction(stem, ".png");
    if (!picture) {
      throw Error("prediction '" + stem.string() + "' is missing, accepted is a .npy or .png");
    }
    path = *picture;
    const cv::Mat image = ReadPicture(path, imaging::DecodeConfig::Pixels::kAsStored);
    if (image.channels() != 1 || (image.depth() != CV_8U && image.depth() != CV_16U)) {
      throw Error("prediction '" + path + "' has " +
                  PixelText(static_cast<int>(8 * image.elemSize1()), image.channels()) +
                  ", accepted is one channel of 8 or 16 bits");
    }
    double most = 0;
    cv::minMaxLoc(image, nullptr, &most);
    if (most >= 1 && most < protocol::kChangeClasses) {
      throw Error("prediction '" + path + "' has the values 0 " + (most == 1 ? "and " : "to ") +
                  std::to_string(static_cast<int>(most)) +
                  " alone, which may be classes, accepted are scores as shares of the full range, "
                  "with " +
                  (image.depth() == CV_8U ? "255" : "65535") + " for a sure change");
    }
    cv::Mat score;
    image.convertTo(score, CV_32FC1, image.depth() == CV_8U ? 1.0 / 255 : 1.0 / 65535);
    probabilities = PredictionFromScore(score);
  }
  CheckProbabilities(probabilities, size, path);
  if (probabilities.of_class.size() == protocol::kChangeClasses)
    CheckPredictionsSumToOne(probabilities, path);
  return probabilities;
}

void WriteScorePicture(const std::string& path, const ChangeProbabilities& probabilities) {
  cv::Mat score;
  cv::subtract(1.0, probabilities.of_class.at(0), score);
  cv::Mat image;
  score.convertTo(image, CV_16UC1, 65535.0);
  WritePredictionPicture(path, image);
}

void WriteClassPicture(const std::string& path, const cv::Mat& classes) {
  WritePredictionPicture(path, classes);
}

}  // namespace livemap::change
