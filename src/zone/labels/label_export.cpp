#include "zone/labels/label_export.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "common/error.h"
#include "common/text_file.h"
#include "common/utc_text.h"
#include "zone/model/decision.h"
#include "zone/store/queries.h"
#include "zone/store/store_connection.h"

namespace livemap::zone {
namespace {

namespace fs = std::filesystem;

/// The first schema that knows where in their pictures hazards are.
constexpr std::int64_t kSchemaWithBoxes = 7;
constexpr std::size_t kMaxDetectorClassBytes = 64;

struct LabelVerdict {
  bool is_confirmed = false;
  std::string official;
  std::int64_t at_ns = 0;
};

struct KnownHazard {
  std::string uuid;
  std::string class_name;
  const LabelVerdict* verdict = nullptr;  ///< Null: nobody has decided.
};

/// Edges in shares of the picture, 0..1.
struct LabelBox {
  std::array<double, 4> edges{};  ///< Left, top, right, bottom.
  const KnownHazard* hazard = nullptr;

  friend bool operator<(const LabelBox& a, const LabelBox& b) {
    return std::pair(a.hazard->uuid, a.edges) < std::pair(b.hazard->uuid, b.edges);
  }
};

using HazardsById = std::map<std::int64_t, KnownHazard>;
using BoxesByPicture = std::map<std::string, std::set<LabelBox>>;  // By SHA-256.

/// As the training accepts it.
bool IsDetectorClass(const std::string& name) {
  return !name.empty() && name.size() <= kMaxDetectorClassBytes && name[0] >= 'a' &&
         name[0] <= 'z' &&
         name.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789_") == std::string::npos;
}

bool IsSha256(const std::string& text) {
  return text.size() == 64 && text.find_first_not_of("0123456789abcdef") == std::string::npos;
}

void RequireSchemaWithBoxes(soci::session& session, const std::string& store) {
  int version = 0;
  session << "SELECT coalesce(max(version), 0) FROM livemap_schema", soci::into(version);
  if (version >= kSchemaWithBoxes) return;
  throw Error("store '" + store + "' has schema version " + std::to_string(version) +
              ", accepted are " + std::to_string(kSchemaWithBoxes) +
              " and later: start the zone once, which brings it up to date");
}

/// The newest confirmation or rejection that stands, by the hazard's uuid.
std::map<std::string, LabelVerdict> ReadVerdicts(StoreConnection& connection) {
  const int confirm = static_cast<int>(DecisionKind::kConfirmHazard);
  const int reject = static_cast<int>(DecisionKind::kRejectHazard);
  std::string subject, official;
  int kind = 0;
  long long at_ns = 0;
  soci::statement find =
      (connection.session().prepare
           << "SELECT subject, kind, official, at_ns FROM decisions WHERE kind "
              "IN (:c, :r) AND undone_by = 0 AND "
           << connection.dialect().AreTexts({{"subject", 64}, {"official", 64}}) << " AND "
           << connection.dialect().AreIntegers({"at_ns"}) << " ORDER BY id",
       soci::use(confirm), soci::use(reject), soci::into(subject), soci::into(kind),
       soci::into(official), soci::into(at_ns));
  std::map<std::string, LabelVerdict> verdicts;
  for (connection.Run(find); find.fetch();) {
    verdicts[subject] = {kind == confirm, official, at_ns};
  }
  return verdicts;
}

HazardsById ReadHazards(StoreConnection& connection,
                        const std::map<std::string, LabelVerdict>& verdicts) {
  std::string uuid, class_name;
  long long id = 0;
  soci::statement find = (connection.session().prepare
                              << "SELECT id, uuid, class_name FROM hazards WHERE "
                              << connection.dialect().AreTexts({{"uuid", 36}, {"class_name", 64}}),
                          soci::into(id), soci::into(uuid), soci::into(class_name));
  HazardsById hazards;
  for (connection.Run(find); find.fetch();) {
    KnownHazard hazard{uuid, class_name, nullptr};
    const auto verdict = verdicts.find(hazard.uuid);
    if (verdict != verdicts.end()) hazard.verdict = &verdict->second;
    hazards.emplace(id, std::move(hazard));
  }
  return hazards;
}

BoxesByPicture ReadBoxes(StoreConnection& connection, const HazardsById& hazards) {
  std::string picture;
  long long id = 0;
  double left = 0, top = 0, right = 0, bottom = 0;
  soci::statement find =
      (connection.session().prepare
           << "SELECT hazard_id, image_sha256, box_left, box_top, box_right, box_bottom FROM "
              "report_boxes WHERE "
           << connection.dialect().AreIntegers({"hazard_id"}) << " AND "
           << connection.dialect().AreTexts({{"image_sha256", 64}}) << " AND "
           << connection.dialect().AreNumbers({"box_left", "box_top", "box_right", "box_bottom"}),
       soci::into(id), soci::into(picture), soci::into(left), soci::into(top), soci::into(right),
       soci::into(bottom));
  BoxesByPicture boxes;
  for (connection.Run(find); find.fetch();) {
    const auto hazard = hazards.find(id);
    // Written so that a row that this program did not write is none, NaN included.
    const bool is_box =
        left >= 0 && top >= 0 && right <= 1 && bottom <= 1 && left < right && top < bottom;
    if (!is_box || hazard == hazards.end() || !IsSha256(picture)) continue;
    boxes[picture].insert({{left, top, right, bottom}, &hazard->second});
  }
  return boxes;
}

bool IsDecided(const LabelBox& box) {
  return box.hazard->verdict != nullptr && IsDetectorClass(box.hazard->class_name);
}

/// The classes of all boxes that are written, in the order of their names.
std::vector<std::string> ClassesOf(const BoxesByPicture& boxes) {
  std::set<std::string> names;
  for (const auto& [picture, in_it] : boxes) {
    if (std::none_of(in_it.begin(), in_it.end(), IsDecided)) continue;
    for (const LabelBox& box : in_it) {
      if (IsDetectorClass(box.hazard->class_name)) names.insert(box.hazard->class_name);
    }
  }
  return {names.begin(), names.end()};
}

/// A field of a table in CSV (RFC 4180). What a spreadsheet would take for a formula is none.
std::string CsvField(const std::string& text) {
  const bool is_formula = !text.empty() && std::string("=+-@").find(text[0]) != std::string::npos;
  std::string field = is_formula ? "\"'" : "\"";
  for (const char c : text) field += c == '"' ? std::string("\"\"") : std::string(1, c);
  return field + '"';
}

/// Writes pictures and labels below one folder.
class LabelWriter {
 public:
  LabelWriter(fs::path store, fs::path out, std::vector<std::string> classes)
      : store_(std::move(store)), out_(std::move(out)), classes_(std::move(classes)) {
    for (const char* folder : {"images", "labels", "difficult"}) {
      fs::create_directories(out_ / folder);
    }
  }

  void Write(const std::string& picture, const std::set<LabelBox>& boxes, LabelExport& done) {
    const fs::path file = PictureFile(picture);
    if (file.empty()) {
      ++done.no_picture;
      return;
    }
    std::string labels;
    std::string difficult;
    for (const LabelBox& box : boxes) {
      if (!IsDetectorClass(box.hazard->class_name)) continue;
      const LabelVerdict* const verdict = box.hazard->verdict;
      if (verdict == nullptr) difficult += LineOf(box);
      if (verdict != nullptr && verdict->is_confirmed) {
        labels += LineOf(box);
        ++done.boxes;
      }
      if (verdict != nullptr) AddDecision(file.filename().string(), *box.hazard);
    }
    fs::copy_file(file, out_ / "images" / file.filename());
    ReplaceTextFile((out_ / "labels" / (picture + ".txt")).string(), labels);
    if (!difficult.empty()) {
      ReplaceTextFile((out_ / "difficult" / (picture + ".txt")).string(), difficult);
    }
    ++done.pictures;
    done.backgrounds += labels.empty() ? 1U : 0U;
  }

  void WriteTables() const {
    std::string names;
    for (const std::string& name : classes_) names += name + "\n";
    ReplaceTextFile((out_ / "classes.txt").string(), names);
    ReplaceTextFile((out_ / "labelled_classes.txt").string(), names);
    ReplaceTextFile((out_ / "decisions.csv").string(),
                    "picture,hazard,class,decision,official,time\n" + decisions_);
  }

 private:
  /// Empty where the store has it no longer.
  fs::path PictureFile(const std::string& picture) const {
    for (const char* format : {".jpeg", ".png"}) {
      fs::path file = store_ / "images" / picture.substr(0, 2) / (picture + format);
      if (fs::is_regular_file(file)) return file;
    }
    return {};
  }

  std::string LineOf(const LabelBox& box) const {
    const auto& [left, top, right, bottom] = box.edges;
    const auto at = std::find(classes_.begin(), classes_.end(), box.hazard->class_name);
    std::string line = std::to_string(at - classes_.begin());
    for (const double number :
         {(left + right) / 2, (top + bottom) / 2, right - left, bottom - top}) {
      std::array<char, 32> text{};
      std::snprintf(text.data(), text.size(), " %.6f", number);
      line += text.data();
    }
    return line + "\n";
  }

  void AddDecision(const std::string& picture, const KnownHazard& hazard) {
    decisions_ += picture + "," + hazard.uuid + "," + hazard.class_name + "," +
                  (hazard.verdict->is_confirmed ? "confirm" : "reject") + "," +
                  CsvField(hazard.verdict->official) + "," + Rfc3339Seconds(hazard.verdict->at_ns) +
                  "\n";
  }

  const fs::path store_;
  const fs::path out_;
  const std::vector<std::string> classes_;
  std::string decisions_;
};

LabelExport CountLeftOut(const HazardsById& hazards, const BoxesByPicture& boxes) {
  std::set<std::string> shown;
  for (const auto& [picture, in_it] : boxes) {
    for (const LabelBox& box : in_it) shown.insert(box.hazard->uuid);
  }
  LabelExport left_out;
  for (const auto& [id, hazard] : hazards) {
    if (hazard.verdict == nullptr) continue;
    if (!IsDetectorClass(hazard.class_name)) {
      ++left_out.odd_classes;
    } else if (shown.count(hazard.uuid) == 0) {
      ++left_out.no_box;
    }
  }
  return left_out;
}

}  // namespace

LabelExport ExportLabels(const std::string& directory, const std::string& out,
                         const std::string& store_url) {
  const std::string store = store_url.empty() ? directory + "/zone.sqlite3" : store_url;
  if (store_url.empty() && !fs::is_regular_file(store)) {
    throw Error("there is no store '" + store + "', accepted is the folder of a zone's store");
  }
  if (fs::exists(out) && (!fs::is_directory(out) || !fs::is_empty(out))) {
    throw Error("'" + out + "' is there already, accepted is a new or an empty folder");
  }
  std::map<std::string, LabelVerdict> verdicts;
  HazardsById hazards;
  BoxesByPicture boxes;
  ExplainStore("reading '" + store + "'", [&] {
    StoreConnection connection(store, StoreConnection::Use::kRead);
    soci::session& session = connection.session();
    RequireSchemaWithBoxes(session, store);
    // Of one moment, also while the zone goes on.
    session << (connection.is_postgresql() ? "BEGIN ISOLATION LEVEL REPEATABLE READ" : "BEGIN");
    verdicts = ReadVerdicts(connection);
    hazards = ReadHazards(connection, verdicts);
    boxes = ReadBoxes(connection, hazards);
    session << "COMMIT";
  });
  LabelExport done = CountLeftOut(hazards, boxes);
  std::vector<std::string> classes = ClassesOf(boxes);
  if (classes.empty()) {
    throw Error("no official has decided about a hazard of which the zone knows a picture's box");
  }
  LabelWriter writer(directory, out, std::move(classes));
  for (const auto& [picture, in_it] : boxes) {
    if (std::any_of(in_it.begin(), in_it.end(), IsDecided)) writer.Write(picture, in_it, done);
  }
  writer.WriteTables();
  return done;
}

}  // namespace livemap::zone
