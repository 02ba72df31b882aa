#include "zone/belief/vehicle_trust.h"

#include <gmock/gmock.h>

#include <cmath>

#include "common/error.h"
#include "test/zone/test_times.h"

namespace livemap::zone {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

TEST(VehicleTrust, NobodyIsKnownAndEverybodyIsANewcomer) {
  const VehicleTrust trust;
  EXPECT_NEAR(trust.MaliciousProbability(7, kStart), 0.05, 1e-9);
  EXPECT_EQ(trust.vehicles(), 0U);
}

TEST(VehicleTrust, ContradictedWordsMakeSuspectAndConfirmedOnesClear) {
  VehicleTrust trust;
  trust.Judge({7, 1.5, 1}, kStart);
  trust.Judge({7, 1.5, 1}, kStart);
  // ln(0.05 / 0.95) + 3.
  EXPECT_NEAR(trust.MaliciousProbability(7, kStart), 1 / (1 + std::exp(2.944439 - 3)), 1e-6);
  for (std::uint64_t voucher = 20; voucher < 40; ++voucher) {
    trust.Judge({7, -0.5, voucher}, kStart);
  }
  EXPECT_NEAR(trust.MaliciousProbability(7, kStart), 0.05, 1e-9);
}

TEST(VehicleTrust, NobodyIsBelievedMoreThanANewcomerHoweverManyVouchForIt) {
  VehicleTrust trust;
  for (std::uint64_t voucher = 20; voucher < 1000; ++voucher) {
    trust.Judge({7, -0.5, voucher}, kStart);
  }
  EXPECT_NEAR(trust.MaliciousProbability(7, kStart), 0.05, 1e-9);
  EXPECT_EQ(trust.vehicles(), 0U) << "nothing is held against it";
  trust.Judge({7, 1.5, 1}, kStart);
  EXPECT_GT(trust.MaliciousProbability(7, kStart), 0.18);
}

TEST(VehicleTrust, ASmallCliqueCannotClearItsMembersHoweverOftenItVouches) {
  VehicleTrust trust;
  for (int lie = 0; lie < 4; ++lie) trust.Judge({7, 1.5, 1}, kStart);
  for (std::uint64_t i = 0; i < 1000; ++i) trust.Judge({7, -0.5, 20 + i % 8}, kStart);
  // Each of the eight counts once: 6 - 8 * 0.5.
  EXPECT_NEAR(trust.MaliciousProbability(7, kStart), 1 / (1 + std::exp(2.944439 - 2)), 1e-6);
}

TEST(VehicleTrust, AnOfficialVouchesAsOftenAsHeLikes) {
  VehicleTrust trust;
  trust.Judge({7, 3, 0}, kStart);
  trust.Judge({7, -1, 0}, kStart);
  trust.Judge({7, -1, 0}, kStart);
  EXPECT_NEAR(trust.MaliciousProbability(7, kStart), 1 / (1 + std::exp(2.944439 - 1)), 1e-6);
}

TEST(VehicleTrust, SuspicionFadesAndIsBounded) {
  VehicleTrust trust;
  for (int i = 0; i < 100; ++i) trust.Judge({7, 1.5, 1}, kStart);
  EXPECT_NEAR(trust.MaliciousProbability(7, kStart), 1 / (1 + std::exp(2.944439 - 6)), 1e-6);
  EXPECT_NEAR(trust.MaliciousProbability(7, kStart + 10 * kDay),
              1 / (1 + std::exp(2.944439 - 6 / M_E)), 1e-6);
  EXPECT_NEAR(trust.MaliciousProbability(7, kStart - kDay), trust.MaliciousProbability(7, kStart),
              1e-9)
      << "a clock that was set back clears nobody";
  EXPECT_EQ(trust.Count(0.5, kStart), 1U);
  EXPECT_EQ(trust.Count(0.5, kStart + 90 * kDay), 0U);
}

TEST(VehicleTrust, ForgetsTheLeastSuspectedWhenThereAreTooMany) {
  VehicleTrust::Config config;
  config.max_vehicles = 2;
  VehicleTrust trust(config);
  trust.Judge({1, 2, 9}, kStart);
  trust.Judge({2, 1, 9}, kStart);
  trust.Judge({3, 1.5, 9}, kStart);
  EXPECT_EQ(trust.vehicles(), 2U);
  EXPECT_NEAR(trust.MaliciousProbability(2, kStart), 0.05, 1e-9);
  EXPECT_GT(trust.MaliciousProbability(1, kStart), trust.MaliciousProbability(3, kStart));
}

TEST(VehicleTrust, PackedUnpackedAndRestoredItIsTheSame) {
  VehicleTrust trust;
  trust.Judge({7, 2.25, 1}, kStart);
  for (std::uint64_t i = 0; i < 11; ++i) trust.Judge({7, -0.1, ~std::uint64_t{0} - i}, kStart);
  const TrustRecord record = trust.Get(7);
  TrustRecord unpacked;
  EXPECT_LE(PackVouchers(record).size(), 200U);
  ASSERT_TRUE(UnpackVouchers(PackVouchers(record), unpacked));
  EXPECT_EQ(unpacked.vouchers, record.vouchers);
  EXPECT_EQ(unpacked.next, record.next);
  VehicleTrust restored;
  EXPECT_TRUE(restored.Restore(7, record));
  EXPECT_EQ(restored.MaliciousProbability(7, kStart + kDay),
            trust.MaliciousProbability(7, kStart + kDay));
}

TEST(VehicleTrust, RefusesRecordsThatAreNone) {
  VehicleTrust trust;
  TrustRecord record;
  EXPECT_FALSE(trust.Restore(0, record));
  record.suspicion = std::nan("");
  EXPECT_FALSE(trust.Restore(7, record));
  record.suspicion = -1;
  EXPECT_FALSE(trust.Restore(7, record));
  for (const char* text : {"", "1", "8 0 0 0 0 0 0 0 0", "0 0 0 0 0 0 0 0 0 0",
                           "0 0 0 0 0 0 0 0 -1", "0 0 0 0 0 0 0 0 18446744073709551616"}) {
    EXPECT_FALSE(UnpackVouchers(text, record)) << text;
  }
  EXPECT_EQ(trust.vehicles(), 0U);
  trust.Judge({7, std::nan(""), 1}, kStart);
  trust.Judge({0, 1, 1}, kStart);
  EXPECT_EQ(trust.vehicles(), 0U);
}

TEST(VehicleTrust, RefusesSettingsThatAreOutOfRangeAndNamesThem) {
  VehicleTrust::Config config;
  config.malicious_share = 0;
  EXPECT_THAT([&] { VehicleTrust{config}; }, ThrowsMessage<Error>(HasSubstr("malicious_share")));
  config = {};
  config.memory_s = std::nan("");
  EXPECT_THAT([&] { VehicleTrust{config}; }, ThrowsMessage<Error>(HasSubstr("trust_memory_s")));
}

}  // namespace
}  // namespace livemap::zone
