#include <gtest/gtest.h>

#include <atomic>
#include <set>
#include <thread>
#include <vector>

#include "zone/zone_service.h"
#include "zone_fixture.h"

namespace livemap {
namespace {

using ZoneThreadsTest = ZoneTest;

TEST_F(ZoneThreadsTest, ReadersSeeOnlyWholeCommittedStatesWhileWritersCommit) {
  ZoneService zone(Config(), Clock(), 1);
  std::vector<std::uint64_t> sequences;
  const int id = zone.Subscribe([&](const ZoneEvent& event) {
    if (event.hazard) sequences.push_back(event.hazard->hazard.sequence);
  });
  std::vector<std::vector<Report>> work(2);
  for (int i = 0; i < 300; ++i) {
    Report report = MakeReport({40 + 0.001 * (i % 40), 8});
    if (i % 7 == 0) report.image = MakeJpeg(64, 48, 50, static_cast<std::uint8_t>(i));
    work[static_cast<std::size_t>(i % 2)].push_back(report);
  }
  std::atomic<bool> done{false};
  std::vector<std::thread> readers;
  for (int reader = 0; reader < 2; ++reader) {
    readers.emplace_back([&] {
      std::uint64_t newest = 0;
      while (!done) {
        const std::uint64_t sequence = zone.Sequence();
        EXPECT_GE(sequence, newest);
        newest = sequence;
        std::uint64_t sightings = 0;
        for (const Hazard& hazard : zone.Query(std::nullopt, 0, 1000)) {
          sightings += hazard.sightings;
          zone.ImagePath(hazard.image_sha256);
        }
        // Every report is one event: the map is never between two of them.
        EXPECT_GE(sightings, sequence);
        zone.Vehicles();
        zone.Statistics();
      }
    });
  }
  std::vector<std::thread> writers;
  for (const std::vector<Report>& reports : work) {
    writers.emplace_back([&zone, &reports] {
      for (std::size_t i = 0; i < reports.size(); i += 3) {
        zone.HandleBatch({reports[i], reports[i + 1], reports[i + 2]});
        zone.UpdateVehicle({"car-1", "", reports[i].position, 0, 0, kNowNs});
      }
    });
  }
  for (std::thread& writer : writers) writer.join();
  const int late = zone.Subscribe([](const ZoneEvent&) {});
  zone.Unsubscribe(late);
  done = true;
  for (std::thread& reader : readers) reader.join();
  zone.Unsubscribe(id);

  ASSERT_EQ(sequences.size(), 300U);
  for (std::size_t i = 0; i < sequences.size(); ++i) EXPECT_EQ(sequences[i], i + 1);
  EXPECT_EQ(zone.Query(std::nullopt, 0, 1000).size(), 40U);
}

}  // namespace
}  // namespace livemap
