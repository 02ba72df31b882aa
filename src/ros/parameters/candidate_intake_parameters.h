#pragma once

#include <string>

#include "ros/parameters/shared/parameter_reader.h"
#include "zone/offload/offload_intake.h"

namespace livemap::ros_io {

/// Defaults of the zone's candidate_intake nodelet; the reader states their meanings.
struct CandidateIntakeConfig {
  zone::OffloadIntake::Config intake;
  std::string catalogue;         ///< Path of the hazard classes; empty: the package's.
  int jpeg_quality = 80;         ///< 1..100, of a report's picture.
  int max_image_bytes = 100000;  ///< Of a report's picture.
  double diagnostics_period_s = 1.0;
};

/// Reads and checks all of them; throws Error.
CandidateIntakeConfig ReadCandidateIntakeConfig(ParameterReader& parameters);

}  // namespace livemap::ros_io
