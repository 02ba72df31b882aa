#pragma once

#include <string>

namespace livemap::tools {

/// The detector that vehicles and zones run unless told otherwise, and that the tools measure.
inline constexpr char kDefaultDetector[] = "hazards-base";

/// models/NAME.yaml: of the installed package (share/livemap beside this program's lib/livemap),
/// else of the source tree that this program was built from.
std::string ShippedModel(const std::string& name);

}  // namespace livemap::tools
