#include "datasets/sensors/gnss_receiver_model.h"

#include <gmock/gmock.h>

#include <cmath>
#include <vector>

#include "common/error.h"

namespace livemap::datasets {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

std::vector<double> EastErrors(const GnssReceiverNoise& noise, int count, double step_s) {
  GnssReceiverModel receiver(noise, 11);
  std::vector<double> errors;
  for (int i = 0; i < count; ++i) errors.push_back(receiver.ErrorAt(i * step_s)->x());
  return errors;
}

/// Mean of x[i] x[i + lag].
double Correlation(const std::vector<double>& x, std::size_t lag) {
  double sum = 0;
  for (std::size_t i = 0; i + lag < x.size(); ++i) sum += x[i] * x[i + lag];
  return sum / static_cast<double>(x.size() - lag);
}

TEST(Receiver, WhiteNoiseHasItsSigmaAndNoMemory) {
  GnssReceiverNoise noise;
  noise.white_sigma_m = 0.8;
  const std::vector<double> errors = EastErrors(noise, 40000, 0.1);
  // Standard errors: variance sqrt(2/n) = 0.7 %, correlation 1/sqrt(n) = 0.5 %; bounds at 5 of
  // them.
  EXPECT_NEAR(Correlation(errors, 0) / 0.64, 1, 0.036);
  EXPECT_NEAR(Correlation(errors, 1) / 0.64, 0, 0.025);
}

TEST(Receiver, BiasHasItsSigmaAndTimeConstant) {
  GnssReceiverNoise noise;
  noise.white_sigma_m = 0;
  noise.bias_sigma_m = 1.5;
  noise.bias_time_constant_s = 20;
  // 200000 s are about 5000 independent values: the variance is known to 2 %, bounds at 5 of them.
  const std::vector<double> errors = EastErrors(noise, 200000, 1.0);
  const double variance = Correlation(errors, 0);
  EXPECT_NEAR(variance / 2.25, 1, 0.1);
  EXPECT_NEAR(Correlation(errors, 20) / variance, std::exp(-1), 0.07);
  EXPECT_NEAR(Correlation(errors, 40) / variance, std::exp(-2), 0.07);
}

TEST(Receiver, DropoutsHaveTheirRateAndLength) {
  GnssReceiverNoise noise;
  noise.dropouts_per_minute = 2;
  noise.dropout_mean_s = 4;
  GnssReceiverModel receiver(noise, 3);
  int lost = 0;
  int losses = 0;
  bool had_fix = true;
  constexpr int kFixes = 600000;
  for (int i = 0; i < kFixes; ++i) {
    const bool has_fix = receiver.ErrorAt(i * 0.1).has_value();
    if (!has_fix) ++lost;
    if (had_fix && !has_fix) ++losses;
    had_fix = has_fix;
  }
  // One loss every 30 + 4 s: 1765 in 60000 s, known to 2.4 %; bounds at 5 of them.
  EXPECT_NEAR(losses, 1765, 220);
  EXPECT_NEAR(lost * 0.1 / losses, 4, 0.5);
  // 4 s of every 34 s; lengths and pauses are exponential, so that the share is known to 3 %.
  EXPECT_NEAR(static_cast<double>(lost) / kFixes, 4.0 / 34, 0.018);
}

TEST(Receiver, SameSeedSameErrors) {
  GnssReceiverNoise noise;
  noise.bias_sigma_m = 1;
  EXPECT_EQ(EastErrors(noise, 50, 0.1), EastErrors(noise, 50, 0.1));
  GnssReceiverModel other(noise, 12);
  EXPECT_NE(other.ErrorAt(0)->x(), EastErrors(noise, 1, 0.1)[0]);
}

TEST(Receiver, StatesTheSigmaOfBothErrors) {
  GnssReceiverNoise noise;
  noise.white_sigma_m = 3;
  noise.bias_sigma_m = 4;
  EXPECT_DOUBLE_EQ(GnssReceiverModel(noise, 1).sigma_m(), 5);
}

TEST(Receiver, RefusesImpossibleNoise) {
  GnssReceiverNoise noise;
  noise.white_sigma_m = -1;
  EXPECT_THAT([&] { GnssReceiverModel(noise, 1); }, ThrowsMessage<Error>(HasSubstr("white noise")));
  noise = {};
  noise.bias_time_constant_s = 0;
  EXPECT_THAT([&] { Check(noise); }, ThrowsMessage<Error>(HasSubstr("bias time constant")));
}

}  // namespace
}  // namespace livemap::datasets
