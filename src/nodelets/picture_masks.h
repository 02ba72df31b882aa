#pragma once

#include <string>

#include "perception/privacy/picture_masker.h"

namespace livemap::nodelets {

/// The masks of faces and number plates as the parameters say. Where they name no manifest of
/// networks it is the package's.
perception::PictureMasker::Config MakeMaskerConfig(bool privacy,
                                                   perception::PrivacyMask::Config mask);

/// Logs what looks for faces and number plates.
void SayWhatFindsFaces(const std::string& nodelet_name, const perception::PictureMasker& masker);

}  // namespace livemap::nodelets
