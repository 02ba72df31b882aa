#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace livemap::imaging {

/// How a player turns and mirrors the frames of an MP4 or MOV file, as EXIF's orientation (see
/// orientation.h): by the matrix of its first video track (ISO/IEC 14496-12 8.3.2, "tkhd"). A phone
/// that is held upright stores its film lying and writes such a matrix. kUpright for other
/// containers, for files that are cut off, and for a matrix that is no quarter turn or mirror.
int ReadVideoOrientation(const std::string& path);

/// The same for the content of the file's box "moov".
int OrientationOfMovie(const std::vector<std::uint8_t>& moov);

}  // namespace livemap::imaging
