#pragma once

#include <gtest/gtest.h>

#include <cstdint>

#include "test/zone/test_times.h"
#include "zone/belief/hazard_lifecycle.h"

namespace livemap::zone {

class HazardLifeTest : public ::testing::Test {
 protected:
  HazardLifeTest() { cone_.survival = {5, 4 * 2 * 86400.0}; }

  static Evidence Word(EvidenceKind kind, std::uint64_t vehicle, std::int64_t at_ns) {
    return {kind, vehicle, at_ns};
  }
  LifecycleUpdate Begin(std::uint64_t vehicle, std::int64_t at_ns = kStart) {
    return rules_.Begin(cone_, Word(EvidenceKind::kSighting, vehicle, at_ns), at_ns, life_);
  }
  LifecycleUpdate Say(EvidenceKind kind, std::uint64_t vehicle, std::int64_t at_ns) {
    return rules_.Apply(cone_, Word(kind, vehicle, at_ns), at_ns, life_);
  }
  LifecycleUpdate See(std::uint64_t vehicle, std::int64_t at_ns) {
    return Say(EvidenceKind::kSighting, vehicle, at_ns);
  }
  LifecycleUpdate Deny(std::uint64_t vehicle, std::int64_t at_ns) {
    return Say(EvidenceKind::kAnswerNo, vehicle, at_ns);
  }
  /// Told to drivers by vehicles 1 and 2.
  void MakeActive() {
    Begin(1);
    See(2, kStart + kSecond);
    ASSERT_EQ(life_.state, HazardState::kActive);
  }
  double Presence(std::int64_t at_ns) const { return rules_.Presence(cone_, life_, at_ns); }

  HazardLifecycle rules_;
  ClassModel cone_;
  PresenceRecord life_;
};

}  // namespace livemap::zone
