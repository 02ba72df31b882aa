#pragma once

#include "common/error.h"

namespace livemap::evaluation {

/// An evaluation whose input is valid but gives no figure: no pair, no label, no fused position.
/// `what()` is the reason in one sentence. The programs print their figures as null with it under
/// the key "reason", and end with exit status 1: a 0 would be a perfect score.
class NothingMeasured : public Error {
 public:
  using Error::Error;
};

}  // namespace livemap::evaluation
