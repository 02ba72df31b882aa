#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/mutex.h"

namespace livemap::web {

/// Raster map tiles of one file, as MBTiles 1.3 defines it: a SQLite database with a table or view
/// `tiles`, whose rows count from the south. The file is only read. Thread-safe; one tile is read
/// at a time. Source: https://github.com/mapbox/mbtiles-spec/blob/master/1.3/spec.md
class TileFile {
 public:
  struct Tile {
    std::shared_ptr<const std::vector<std::uint8_t>> content;
    const char* media_type = "";  ///< By the content's first bytes, whatever the file says of it.
  };

  /// Opens the file. Throws Error that names it and says what is accepted: for a file that cannot
  /// be read, is no SQLite database, has no `tiles`, or has tiles of vectors.
  explicit TileFile(const std::string& path);
  ~TileFile();
  TileFile(const TileFile&) = delete;
  TileFile& operator=(const TileFile&) = delete;

  /// The tile in column `x` from the west and row `y` from the north of the 2^zoom by 2^zoom ones
  /// around the world. None where the file has none, for a row of more than 2 MB, for content that
  /// is neither PNG, JPEG nor WebP, and where the file needs very many steps to find it.
  std::optional<Tile> Find(int zoom, std::uint32_t x, std::uint32_t y) const;
  /// The zooms that the file says it has; 0 and 22 where it does not say.
  int min_zoom() const { return min_zoom_; }
  int max_zoom() const { return max_zoom_; }
  /// Whom to credit, as plain text; empty where the file does not say.
  const std::string& attribution() const { return attribution_; }

 private:
  class Database;

  std::string Metadata(const std::string& name) const REQUIRES(mutex_);
  int ZoomOf(const std::string& name, int unsaid) const REQUIRES(mutex_);

  mutable Mutex mutex_;
  std::unique_ptr<Database> database_ GUARDED_BY(mutex_);
  int min_zoom_ = 0;
  int max_zoom_ = 22;
  std::string attribution_;
};

/// A tile's place in "/tiles/ZOOM/X/Y"; none for any other path, and for a tile that there cannot
/// be: zooms are 0 to 22.
struct TilePlace {
  int zoom = 0;
  std::uint32_t x = 0;
  std::uint32_t y = 0;
};
std::optional<TilePlace> ParseTilePath(const std::string& path);

}  // namespace livemap::web
