#pragma once

#include <cstddef>
#include <string>

namespace livemap::zone {

/// What was written, and what was not.
struct LabelExport {
  std::size_t pictures = 0;     ///< Written.
  std::size_t boxes = 0;        ///< Of confirmed hazards, in their labels.
  std::size_t backgrounds = 0;  ///< Pictures of these without any label: of rejected hazards alone.
  std::size_t no_picture = 0;   ///< Left out: the picture is no longer on disk.
  std::size_t no_box = 0;       ///< Decided hazards of which no picture's box is known.
  std::size_t odd_classes = 0;  ///< Decided hazards of classes whose names a detector cannot have.
};

/// Writes what officials decided as labelled pictures, from which a detector learns: the pictures
/// that vehicles sent of hazards about which a confirmation or a rejection stands. `out` gets
/// images/, labels/ (YOLO: a line CLASS CX CY WIDTH HEIGHT in shares of the picture for each
/// confirmed hazard), difficult/ (the same for hazards in these pictures about which nobody has
/// decided: they count as neither), classes.txt, labelled_classes.txt, and decisions.csv, which
/// says who decided what of which picture, and when.
///
/// `directory` is the zone's, and so is `store_url` (ZoneConfig); the zone may be running. Throws
/// Error when that holds no store, or `out` holds anything already, or there is nothing to write;
/// StoreError when the store fails.
LabelExport ExportLabels(const std::string& directory, const std::string& out,
                         const std::string& store_url = "");

}  // namespace livemap::zone
