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
#include "common/sqlite.h"
#include "common/text_file.h"
#include "common/utc_text.h"
#include "zone/model/decision.h"

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

void RequireSchemaWithBoxes(SqliteDatabase& database, const std::string& path) {
  SqliteStatement find = database.Prepare("SELECT coalesce(max(version), 0) FROM livemap_schema");
  const std::int64_t version = find.Step() ? find.Int(0) : 0;
  if (version >= kSchemaWithBoxes) return;
  throw Error("store '" + path + "' has schema version " + std::to_string(version) +
              ", accepted are " + std::to_string(kSchemaWithBoxes) +
              " and later: start the zone once, which brings it up to date");
}

/// The newest confirmation or rejection that stands, by the hazard's uuid.
std::map<std::string, LabelVerdict> ReadVerdicts(SqliteDatabase& database) {
  std::map<std::string, LabelVerdict> verdicts;
  SqliteStatement find = database.Prepare(
      "SELECT subject, kind, official, at_ns FROM decisions WHERE kind IN (?, ?) AND undone_by = 0 "
      "ORDER BY id");
  const auto confirm = static_cast<std::int64_t>(DecisionKind::kConfirmHazard);
  find.Bind(1, confirm).Bind(2, static_cast<std::int64_t>(DecisionKind::kRejectHazard));
  while (find.Step()) {
    verdicts[find.Text(0)] = {find.Int(1) == confirm, find.Text(2), find.Int(3)};
  }
  return verdicts;
}

HazardsById ReadHazards(SqliteDatabase& database,
                        const std::map<std::string, LabelVerdict>& verdicts) {
  HazardsById hazards;
  SqliteStatement find = database.Prepare("SELECT id, uuid, class_name FROM hazards");
  while (find.Step()) {
    KnownHazard hazard{find.Text(1), find.Text(2), nullptr};
    const auto verdict = verdicts.find(hazard.uuid);
    if (verdict != verdicts.end()) hazard.verdict = &verdict->second;
    hazards.emplace(find.Int(0), std::move(hazard));
  }
  return hazards;
}

BoxesByPicture ReadBoxes(SqliteDatabase& database, const HazardsById& hazards) {
  BoxesByPicture boxes;
  SqliteStatement find = database.Prepare(
      "SELECT hazard_id, image_sha256, box_left, box_top, box_right, box_bottom FROM report_boxes");
  while (find.Step()) {
    const auto hazard = hazards.find(find.Int(0));
    const std::string picture = find.Text(1);
    const LabelBox box{{find.Real(2), find.Real(3), find.Real(4), find.Real(5)},
                       hazard == hazards.end() ? nullptr : &hazard->second};
    const auto& [left, top, right, bottom] = box.edges;
    // Written so that a row that this program did not write is none, NaN included.
    const bool is_box =
        left >= 0 && top >= 0 && right <= 1 && bottom <= 1 && left < right && top < bottom;
    if (is_box && box.hazard != nullptr && IsSha256(picture)) boxes[picture].insert(box);
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

LabelExport ExportLabels(const std::string& directory, const std::string& out) {
  const std::string path = directory + "/zone.sqlite3";
  if (!fs::is_regular_file(path)) {
    throw Error("there is no store '" + path + "', accepted is the folder of a zone's store");
  }
  if (fs::exists(out) && (!fs::is_directory(out) || !fs::is_empty(out))) {
    throw Error("'" + out + "' is there already, accepted is a new or an empty folder");
  }
  SqliteDatabase database(path, true);
  database.Execute("PRAGMA query_only=ON");
  RequireSchemaWithBoxes(database, path);
  std::map<std::string, LabelVerdict> verdicts;
  HazardsById hazards;
  BoxesByPicture boxes;
  // Of one moment, also while the zone goes on.
  database.Execute("BEGIN");
  verdicts = ReadVerdicts(database);
  hazards = ReadHazards(database, verdicts);
  boxes = ReadBoxes(database, hazards);
  database.Execute("COMMIT");
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
