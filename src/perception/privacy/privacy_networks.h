#pragma once

#include <string>

#include "perception/inference/model_manifest.h"

namespace livemap::perception {

/// The networks that find faces and number plates: the content of models/privacy.yaml, checked.
/// Their files are third-party and do not come with LiveMap; `./livemap privacy-models` places
/// them. models/README.md describes the manifest key by key.
struct PrivacyNetworks {
  struct Network {
    std::string file;     ///< Path of the ONNX file.
    std::string sha256;   ///< Of that file, 64 lower-case hexadecimal digits.
    std::string origin;   ///< Where it comes from, a URL.
    std::string licence;  ///< As stated there.
    ModelManifest::Input input;
    ModelManifest::Normalisation normalisation;
    float found = 0;  ///< From this score on a find counts, (0, 1).
    float sure = 0;   ///< From this score on it is sure, at least `found`; of road users unused.
  };

  Network faces;       ///< UltraFace (RFB-320).
  Network plates;      ///< LPD-YuNet, which takes other sizes than its file declares.
  Network road_users;  ///< YOLOX of COCO's 80 classes: the people and vehicles to look at closely.
};

/// Reads and checks the manifest; its files are resolved against its folder and not touched. Throws
/// Error naming the file, the key, its value and what is accepted; unknown, missing and repeated
/// keys are errors too.
PrivacyNetworks ReadPrivacyNetworks(const std::string& path);

/// The same from text; `origin` names it in errors and `directory` is what its files are relative
/// to.
PrivacyNetworks ParsePrivacyNetworks(const std::string& yaml, const std::string& origin,
                                     const std::string& directory);

/// Whether something stands where a file of the networks belongs, whatever it is. True also when
/// that cannot be found out: who cannot look must not take it that nothing is there.
bool IsAnyPlaced(const PrivacyNetworks& networks);

}  // namespace livemap::perception
