#include "web/tiles/tile_file.h"

#include <sqlite3.h>

#include <array>
#include <charconv>
#include <cstring>
#include <string_view>

#include "common/error.h"
#include "common/text.h"

namespace livemap::web {
namespace {

constexpr int kMaxZoom = 22;
constexpr std::int64_t kMaxTileBytes = 2 << 20;
constexpr std::size_t kMaxAttributionBytes = 300;
/// A view may hide any query behind a tile: it ends after some hundred milliseconds.
constexpr int kMaxThousandSteps = 5000;
constexpr const char* kAccepted =
    "accepted are MBTiles files with raster tiles in PNG, JPEG or WebP";

int StopAfterManySteps(void* steps) { return ++*static_cast<int*>(steps) > kMaxThousandSteps; }

/// The media type of a picture; nullptr for anything else.
const char* MediaTypeOf(const std::vector<std::uint8_t>& content) {
  const auto begins = [&](std::string_view bytes, std::size_t at) {
    return content.size() >= at + bytes.size() &&
           std::memcmp(content.data() + at, bytes.data(), bytes.size()) == 0;
  };
  if (begins("\x89PNG\r\n\x1a\n", 0)) return "image/png";
  if (begins("\xff\xd8\xff", 0)) return "image/jpeg";
  return begins("RIFF", 0) && begins("WEBP", 8) ? "image/webp" : nullptr;
}

/// Credits are often links: what is between angle brackets goes.
std::string WithoutTags(const std::string& text) {
  std::string plain;
  bool in_tag = false;
  for (const char c : text) {
    if (c == '<') in_tag = true;
    if (!in_tag && static_cast<unsigned char>(c) >= ' ') plain += c;
    if (c == '>') in_tag = false;
  }
  for (const auto& [entity, sign] : {std::pair("&copy;", "\u00a9"), std::pair("&amp;", "&")}) {
    for (std::size_t at = plain.find(entity); at != std::string::npos;
         at = plain.find(entity, at + 1)) {
      plain.replace(at, std::strlen(entity), sign);
    }
  }
  return CutUtf8(plain, kMaxAttributionBytes);
}

}  // namespace

/// The open database. A query that fails has no row.
class TileFile::Database {
 public:
  explicit Database(const std::string& path) {
    const int code = sqlite3_open_v2(path.c_str(), &handle_,
                                     SQLITE_OPEN_READONLY | SQLITE_OPEN_NOMUTEX, nullptr);
    // The file is another's: its schema may call no functions with effects.
    sqlite3_db_config(handle_, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
    sqlite3_db_config(handle_, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
    sqlite3_progress_handler(handle_, 1000, StopAfterManySteps, &thousand_steps_);
    if (code == SQLITE_OK) {
      tile_ = Prepare(
          "SELECT tile_data FROM tiles WHERE zoom_level = ?1 AND tile_column = ?2 AND "
          "tile_row = ?3 AND typeof(tile_data) = 'blob' AND length(tile_data) <= ?4 LIMIT 1");
    }
    if (tile_ == nullptr) error_ = sqlite3_errmsg(handle_);
    metadata_ = Prepare("SELECT value FROM metadata WHERE name = ?1 LIMIT 1");
  }
  ~Database() {
    sqlite3_finalize(tile_);
    sqlite3_finalize(metadata_);
    sqlite3_close(handle_);
  }
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;

  /// Why it cannot be used; empty when it can.
  const std::string& error() const { return error_; }

  std::optional<std::vector<std::uint8_t>> Tile(int zoom, std::int64_t column, std::int64_t row) {
    sqlite3_bind_int(tile_, 1, zoom);
    sqlite3_bind_int64(tile_, 2, column);
    sqlite3_bind_int64(tile_, 3, row);
    sqlite3_bind_int64(tile_, 4, kMaxTileBytes);
    return Blob(tile_);
  }
  std::optional<std::vector<std::uint8_t>> Metadata(const std::string& name) {
    if (metadata_ == nullptr) return std::nullopt;
    sqlite3_bind_text(metadata_, 1, name.c_str(), -1, SQLITE_TRANSIENT);
    return Blob(metadata_);
  }

 private:
  sqlite3_stmt* Prepare(const char* sql) {
    thousand_steps_ = 0;
    sqlite3_stmt* statement = nullptr;
    sqlite3_prepare_v2(handle_, sql, -1, &statement, nullptr);
    return statement;
  }

  std::optional<std::vector<std::uint8_t>> Blob(sqlite3_stmt* statement) {
    thousand_steps_ = 0;
    std::optional<std::vector<std::uint8_t>> content;
    if (sqlite3_step(statement) == SQLITE_ROW) {
      const auto* const bytes = static_cast<const std::uint8_t*>(sqlite3_column_blob(statement, 0));
      const auto size = static_cast<std::size_t>(sqlite3_column_bytes(statement, 0));
      content.emplace();
      if (bytes != nullptr && size <= kMaxTileBytes) content->assign(bytes, bytes + size);
    }
    sqlite3_reset(statement);
    return content;
  }

  sqlite3* handle_ = nullptr;
  sqlite3_stmt* tile_ = nullptr;
  sqlite3_stmt* metadata_ = nullptr;
  int thousand_steps_ = 0;
  std::string error_;
};

TileFile::TileFile(const std::string& path) {
  const MutexLock lock(mutex_);
  database_ = std::make_unique<Database>(path);
  std::string why = database_->error();
  const std::string format = why.empty() ? Metadata("format") : "";
  if (format == "pbf") why = "its tiles are vectors (format 'pbf')";
  if (!why.empty())
    throw Error("the tile file '" + path + "' is refused: " + why + "; " + kAccepted);
  min_zoom_ = ZoomOf("minzoom", 0);
  max_zoom_ = ZoomOf("maxzoom", kMaxZoom);
  attribution_ = WithoutTags(Metadata("attribution"));
}

TileFile::~TileFile() = default;

std::string TileFile::Metadata(const std::string& name) const {
  const auto value = database_->Metadata(name);
  return value ? std::string(value->begin(), value->end()) : "";
}

int TileFile::ZoomOf(const std::string& name, int unsaid) const {
  const std::string text = Metadata(name);
  int zoom = 0;
  const auto read = std::from_chars(text.data(), text.data() + text.size(), zoom);
  return read.ec == std::errc() && zoom >= 0 && zoom <= kMaxZoom ? zoom : unsaid;
}

std::optional<TileFile::Tile> TileFile::Find(int zoom, std::uint32_t x, std::uint32_t y) const {
  if (zoom < 0 || zoom > kMaxZoom) return std::nullopt;
  const std::int64_t count = std::int64_t{1} << zoom;
  if (x >= count || y >= count) return std::nullopt;
  std::optional<std::vector<std::uint8_t>> content;
  {
    const MutexLock lock(mutex_);
    content = database_->Tile(zoom, x, count - 1 - y);
  }
  const char* const type = content ? MediaTypeOf(*content) : nullptr;
  if (type == nullptr) return std::nullopt;
  return Tile{std::make_shared<const std::vector<std::uint8_t>>(std::move(*content)), type};
}

std::optional<TilePlace> ParseTilePath(const std::string& path) {
  constexpr std::string_view kPrefix = "/tiles/";
  if (path.compare(0, kPrefix.size(), kPrefix) != 0) return std::nullopt;
  std::array<std::uint32_t, 3> numbers{};
  const char* at = path.data() + kPrefix.size();
  const char* const end = path.data() + path.size();
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const auto read = std::from_chars(at, end, numbers[i]);
    const bool is_last = i + 1 == numbers.size();
    if (read.ec != std::errc() ||
        (is_last ? read.ptr != end : read.ptr == end || *read.ptr != '/')) {
      return std::nullopt;
    }
    at = read.ptr + 1;
  }
  const auto [zoom, x, y] = numbers;
  if (zoom > kMaxZoom || x >> zoom != 0 || y >> zoom != 0) return std::nullopt;
  return TilePlace{static_cast<int>(zoom), x, y};
}

}  // namespace livemap::web
