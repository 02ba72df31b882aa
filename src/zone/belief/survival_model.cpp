#include "zone/belief/survival_model.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/error.h"

namespace livemap::zone {
namespace {

bool IsSurvivalAmount(double value) { return std::isfinite(value) && value >= 0; }

}  // namespace

double ClassSurvival::Survival(double age_s, double dt_s) const {
  if (!(dt_s > 0)) return 1;
  const double elapsed_s = scale_s + std::max(age_s, 0.0);
  return std::pow(elapsed_s / (elapsed_s + dt_s), shape);
}

double ClassSurvival::TimeTo(double probability, double age_s) const {
  const double elapsed_s = scale_s + std::max(age_s, 0.0);
  return elapsed_s * (std::pow(probability, -1 / shape) - 1);
}

double ClassSurvival::ExpectedTimeStanding(double age_s, double dt_s) const {
  if (!(dt_s > 0)) return 0;
  const double elapsed_s = scale_s + std::max(age_s, 0.0);
  // 1 - (e / (e + dt))^(a - 1), without the loss of digits for a dt that is small beside e.
  const double ended = -std::expm1(-(shape - 1) * std::log1p(dt_s / elapsed_s));
  return elapsed_s / (shape - 1) * ended;
}

SurvivalModel::SurvivalModel(protocol::HazardCatalogue catalogue)
    : SurvivalModel(std::move(catalogue), Config()) {}

SurvivalModel::SurvivalModel(protocol::HazardCatalogue catalogue, Config config)
    : catalogue_(std::move(catalogue)), config_(config) {
  if (!(config_.prior_weight >= 0.5 && config_.prior_weight <= 1000)) {
    throw Error("prior_weight is " + std::to_string(config_.prior_weight) +
                ", accepted is 0.5 to 1000 ended lives");
  }
  if (!(config_.memory >= 1 && config_.memory <= 1e6)) {
    throw Error("memory is " + std::to_string(config_.memory) +
                ", accepted is 1 to 1000000 ended lives");
  }
}

void SurvivalModel::Restore(const std::string& class_name, const LearnedLifetime& learned) {
  if (!IsSurvivalAmount(learned.ended) || !IsSurvivalAmount(learned.stood_s)) {
    throw Error("what was learned of the lives of class '" + class_name +
                "' is not two finite numbers from 0 on");
  }
  learned_[class_name] = learned;
}

void SurvivalModel::Learn(const std::string& class_name, const LifetimeObservation& lesson) {
  if (!IsSurvivalAmount(lesson.stood_s) || (lesson.stood_s == 0 && !lesson.ended)) return;
  LearnedLifetime& learned = learned_[class_name];
  learned.stood_s += lesson.stood_s;
  learned.ended += lesson.ended ? 1 : 0;
  // Both fade together, so that their ratio, the rate, stays.
  if (learned.ended <= config_.memory) return;
  learned.stood_s *= config_.memory / learned.ended;
  learned.ended = config_.memory;
}

void SurvivalModel::Unlearn(const std::string& class_name, const LifetimeObservation& lesson) {
  const auto known = learned_.find(class_name);
  if (known == learned_.end() || !(lesson.stood_s >= 0)) return;
  known->second.stood_s = std::max(0.0, known->second.stood_s - lesson.stood_s);
  if (lesson.ended) known->second.ended = std::max(0.0, known->second.ended - 1);
}

ClassSurvival SurvivalModel::Of(const std::string& class_name) const {
  const double prior_life_s = catalogue_.Get(class_name).expected_life_s;
  ClassSurvival survival;
  survival.shape = config_.prior_weight + 1;
  survival.scale_s = config_.prior_weight * prior_life_s;
  const auto found = learned_.find(class_name);
  if (found == learned_.end()) return survival;
  survival.shape += found->second.ended;
  survival.scale_s += found->second.stood_s;
  return survival;
}

}  // namespace livemap::zone
