#pragma once

namespace livemap::perception {

/// Whether the processor multiplies and adds whole numbers of 8 bits in one instruction (VNNI, as
/// AVX-512 VNNI or AVX-VNNI), and the system lets programs use it. Without it, oneDNN adds two
/// products in 16 bits, which overflow, and a network in 8 bits is not that of its manifest.
bool HasInt8Instructions();

}  // namespace livemap::perception
