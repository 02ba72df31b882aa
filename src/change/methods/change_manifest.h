#pragma once

#include <optional>
#include <string>

#include "perception/inference/model_manifest.h"

namespace livemap::change {

/// Everything that must be known about a network of change to run it: the content of
/// models/NAME.yaml of `kind: change`, checked. models/README.md ("Models of change") describes
/// the file.
struct ChangeManifest {
  /// An ONNX file.
  struct Graph {
    std::string file;    ///< Path.
    std::string sha256;  ///< 64 lower-case hexadecimal digits.
  };

  /// How the road is looked at by itself, see class RoadLook.
  struct RoadLook {
    Graph graph;         ///< One picture's road to a detector's features at stride 8.
    int width = 0;       ///< Of the graph's input, pixels, a multiple of 8.
    int height = 0;      ///< The same.
    std::string output;  ///< Name of the features.
    /// Least RoadAlignment::agreement at which the two roads are compared, (0, 1].
    double least_agreement = 0.45;
    /// Log odds of change: features * log(distance of features) + colours * log(distance of
    /// colours) + bias.
    double features = 0;
    double colours = 0;
    double bias = 0;
  };

  std::string name;
  Graph whole;    ///< Two pictures and validity to probabilities.
  Graph encoder;  ///< One picture to its features.
  Graph head;     ///< Features of both and validity to probabilities.
  perception::ModelManifest::Input input;
  /// Share of a picture's width whose middle the network also looks at by itself, so that small
  /// things on the road ahead keep their pixels; 0: at the whole alone.
  double closer_look = 0;
  perception::ModelManifest::Normalisation normalisation;
  int levels = 0;      ///< Of features, 1 to 10.
  std::string output;  ///< Name of the probabilities.
  std::optional<RoadLook> road;
  /// Least 1 - probability of no change at which a pixel counts as changed, (0, 1); the others have
  /// that share of false positives on the validation pairs.
  double changed = 0.5;
  double changed_at_fpr_001 = 0.5;
  double changed_at_fpr_010 = 0.5;
};

/// Reads and checks a manifest file; its graphs are resolved against its folder and not touched.
/// Throws Error naming the file, the key, its value and what is accepted; unknown, missing and
/// repeated keys are errors too, and so are classes other than those of ChangeClass.
ChangeManifest ReadChangeManifest(const std::string& path);

/// The same from text; `origin` names it in errors, `directory` is what its files are relative to.
ChangeManifest ParseChangeManifest(const std::string& yaml, const std::string& origin,
                                   const std::string& directory);

}  // namespace livemap::change
