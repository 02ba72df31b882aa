#include "recordings/positions/gpx_track.h"

#include <expat.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <string_view>
#include <utility>

#include "common/error.h"
#include "common/text_file.h"
#include "datasets/text_parsing.h"
#include "recordings/positions/position_fields.h"
#include "recordings/time_text.h"

namespace livemap::recordings {
namespace {

constexpr int kMaxDepth = 64;

/// Follows one XML text. Expat is C: what a handler finds wrong is kept and thrown afterwards.
class GpxParser {
 public:
  explicit GpxParser(std::string name)
      : name_(std::move(name)), parser_(XML_ParserCreate(nullptr), &XML_ParserFree) {
    if (!parser_) throw Error("no memory for reading '" + name_ + "'");
    XML_SetUserData(parser_.get(), this);
    XML_SetElementHandler(parser_.get(), &GpxParser::OnStart, &GpxParser::OnEnd);
    XML_SetCharacterDataHandler(parser_.get(), &GpxParser::OnText);
    XML_SetStartDoctypeDeclHandler(parser_.get(), &GpxParser::OnDoctype);
  }

  RecordedTrack Parse(const std::string& text) {
    constexpr std::size_t kPiece = 1U << 20U;
    for (std::size_t at = 0; at == 0 || at < text.size(); at += kPiece) {
      const std::size_t size = std::min(kPiece, text.size() - at);
      const bool last = at + size >= text.size();
      const auto status =
          XML_Parse(parser_.get(), text.data() + at, static_cast<int>(size), last ? 1 : 0);
      if (!fault_.empty()) throw Error(fault_);
      if (status == XML_STATUS_ERROR) {
        throw Error(Where() + " is no XML: " + XML_ErrorString(XML_GetErrorCode(parser_.get())));
      }
    }
    if (positions_.empty() && timeless_.count() > 0) {
      throw Error("no point of '" + name_ + "' has a time, the first is line " +
                  std::to_string(timeless_.first_line()) +
                  ": accepted is a recorded track, not a planned route");
    }
    std::vector<std::string> notes;
    timeless_.Tell(name_, notes);
    return OrderTrack(std::move(positions_), std::move(notes), name_);
  }

 private:
  static void OnStart(void* self, const char* element, const char** attributes) {
    static_cast<GpxParser*>(self)->Guard(
        [&](GpxParser& parser) { parser.Start(element, attributes); });
  }
  static void OnEnd(void* self, const char* element) {
    static_cast<GpxParser*>(self)->Guard([&](GpxParser& parser) { parser.End(element); });
  }
  static void OnText(void* self, const char* text, int size) {
    GpxParser& parser = *static_cast<GpxParser*>(self);
    // No number or time is longer.
    if (parser.in_point_ && parser.text_.size() + static_cast<std::size_t>(size) <= 256) {
      parser.text_.append(text, static_cast<std::size_t>(size));
    }
  }
  static void OnDoctype(void* self, const char*, const char*, const char*, int) {
    static_cast<GpxParser*>(self)->Guard([](GpxParser& parser) {
      throw Error(parser.Where() + " declares a DOCTYPE, accepted is GPX without one");
    });
  }

  template <typename Work>
  void Guard(const Work& work) {
    if (!fault_.empty()) return;
    try {
      work(*this);
    } catch (const Error& error) {
      fault_ = error.what();
      XML_StopParser(parser_.get(), XML_FALSE);
    }
  }

  std::size_t Line() const { return XML_GetCurrentLineNumber(parser_.get()); }
  std::string Where() const { return "line " + std::to_string(Line()) + " of '" + name_ + "'"; }

  /// Without the prefix of a namespace.
  static std::string_view LocalName(const char* element) {
    const char* const colon = std::strrchr(element, ':');
    return colon != nullptr ? colon + 1 : element;
  }

  void Start(const char* element, const char** attributes) {
    const std::string_view local = LocalName(element);
    if (depth_ == 0 && local != "gpx") {
      throw Error(Where() + " begins with <" + std::string(local.substr(0, 40)) +
                  ">, accepted is <gpx>");
    }
    if (++depth_ > kMaxDepth) throw Error(Where() + " is nested too deeply for GPX");
    text_.clear();
    if (local != "trkpt") return;
    if (in_point_) throw Error(Where() + " has a <trkpt> within a <trkpt>");
    in_point_ = true;
    has_time_ = false;
    point_ = RecordedPosition();
    point_.line = Line();
    std::string latitude, longitude;
    for (const char** attribute = attributes; *attribute != nullptr; attribute += 2) {
      if (std::strcmp(attribute[0], "lat") == 0) latitude = attribute[1];
      if (std::strcmp(attribute[0], "lon") == 0) longitude = attribute[1];
    }
    point_.position = ReadPosition(latitude, longitude, Where());
  }

  void End(const char* element) {
    --depth_;
    if (!in_point_) return;
    const std::string_view local = LocalName(element);
    if (local == "time") {
      const std::optional<TimeText> time = ParseTimeText(Trimmed());
      if (!time) {
        throw Error(Where() + " has the time '" + text_.substr(0, 40) +
                    "', accepted is UTC like 2026-01-31T12:34:56Z");
      }
      point_.stamp_ns = time->stamp_ns;
      has_time_ = true;
    } else if (local == "ele") {
      point_.altitude_m = Number("ele", -1000, 20000);
    } else if (local == "speed") {
      point_.speed_mps = ReadSpeed(Trimmed(), 1, Where());
    } else if (local == "course") {
      point_.course_deg = ReadCourse(Trimmed(), Where());
    } else if (local == "hdop") {
      const double hdop = Number("hdop", 0, 1e4);
      if (hdop > 0) point_.sigma_m = hdop * kMetresPerHdop;
    } else if (local == "trkpt") {
      in_point_ = false;
      if (has_time_) {
        positions_.push_back(point_);
      } else {
        timeless_.Count(point_.line);
      }
    }
    text_.clear();
  }

  std::string Trimmed() const {
    constexpr char kBlanks[] = " \t\r\n";
    const std::size_t begin = text_.find_first_not_of(kBlanks);
    if (begin == std::string::npos) return "";
    return text_.substr(begin, text_.find_last_not_of(kBlanks) + 1 - begin);
  }

  double Number(const char* element, double min, double max) const {
    const std::optional<double> value = datasets::ParseFinite(Trimmed());
    if (value && *value >= min && *value <= max) return *value;
    throw Error(Where() + " has the " + element + " '" + text_.substr(0, 40) +
                "', accepted is a number from " + std::to_string(min) + " to " +
                std::to_string(max));
  }

  const std::string name_;
  std::unique_ptr<XML_ParserStruct, decltype(&XML_ParserFree)> parser_;
  std::string fault_;
  std::string text_;  ///< Of the innermost element.
  int depth_ = 0;
  bool in_point_ = false;
  bool has_time_ = false;
  RecordedPosition point_;
  std::vector<RecordedPosition> positions_;
  LeftOut timeless_{"points without a time, left out"};
};

}  // namespace

RecordedTrack ParseGpx(const std::string& text, const std::string& name) {
  return GpxParser(name).Parse(text);
}

RecordedTrack ReadGpx(const std::string& path) {
  return ParseGpx(ReadTextFile(path, datasets::kMaxTextBytes), path);
}

}  // namespace livemap::recordings
