#pragma once

// Part of ZoneStore; nobody else includes this.
#include <cstdint>
#include <string>
#include <vector>

#include "zone/desk/frame_request.h"
#include "zone/store/store_connection.h"

namespace livemap::zone {

/// The table `answer_pictures`: which pictures came with answers to polls, and for which official's
/// request. Every function throws StoreError. Few rows are written, so that no statement is kept
/// ready.
class AnswerPictureTable {
 public:
  /// Keeps the connection; the schema is up to date.
  explicit AnswerPictureTable(StoreConnection& connection) : connection_(connection) {}

  /// As ZoneStore's functions of these names.
  void WriteAnswerPicture(const Uuid& poll, std::uint64_t hazard_id,
                          const std::string& image_sha256, std::uint64_t decision);
  std::vector<AnswerPicture> LoadAnswerPictures(std::uint64_t hazard_id, std::size_t limit);
  std::vector<FrameRequest> LoadFrameRequests(std::int64_t since_ns);

 private:
  StoreConnection& connection_;
};

}  // namespace livemap::zone
