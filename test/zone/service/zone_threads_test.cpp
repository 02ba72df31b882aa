#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <future>
#include <set>
#include <thread>
#include <vector>

#include "common/sqlite.h"
#include "test/zone/zone_fixture.h"
#include "zone/service/zone_service.h"

namespace livemap::zone {
namespace {

using ZoneThreadsTest = ZoneTest;

TEST_F(ZoneThreadsTest, ReadersSeeOnlyWholeCommittedStatesWhileWritersCommit) {
  ZoneService zone(Config(), Clock(), 1);
  std::vector<std::uint64_t> sequences;
  const int id = zone.Subscribe([&](const ZoneEvent& event) {
    if (event.hazard) sequences.push_back(event.hazard->hazard.sequence);
  });
  std::vector<std::vector<protocol::Report>> work(2);
  for (int i = 0; i < 300; ++i) {
    protocol::Report report = MakeReport({40 + 0.001 * (i % 40), 8});
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
  for (const std::vector<protocol::Report>& reports : work) {
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

/// A commit that the disk holds up: another connection has the database's write lock, for which a
/// commit waits ten seconds and then fails.
class SlowCommit {
 public:
  SlowCommit(ZoneService& zone, StoreProbe other) : other_(std::move(other)) {
    other_.HoldWriters();
    writer_ = std::thread([this, &zone, report = MakeReport({1, 1})] {
      try {
        is_committed_ = zone.Handle(report).status == protocol::Receipt::Status::kCommitted;
      } catch (const StoreError&) {
      }
    });
    // For it to get there; with less time a test would pass, too, but prove nothing.
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
  }
  /// Whether it went well: nobody waited for it before.
  bool LetGo() {
    other_.Release();
    writer_.join();
    return is_committed_;
  }

 private:
  StoreProbe other_;
  std::thread writer_;
  bool is_committed_ = false;
};

TEST_F(ZoneThreadsTest, TheNewestSequenceIsToldWhileACommitWaitsForTheDisk) {
  ZoneService zone(Config(), Clock(), 1);
  zone.Handle(MakeReport());
  SlowCommit commit(zone, Probe());
  EXPECT_EQ(zone.Sequence(), 1U);
  EXPECT_EQ(zone.AnnouncedSequence(), 1U);
  EXPECT_TRUE(commit.LetGo());
  EXPECT_EQ(zone.Sequence(), 2U);
  EXPECT_EQ(zone.AnnouncedSequence(), 2U);
}

TEST_F(ZoneThreadsTest, AHistoryIsReadWhileTheWriterIsAtWork) {
  ZoneService zone(Config(), Clock(), 1);
  const Uuid hazard = zone.Handle(MakeReport()).hazard_uuid;
  std::promise<std::size_t> events;
  std::future<std::size_t> read = events.get_future();
  std::thread reader;
  bool is_read = false;
  // Subscribers are called by the writer, which waits for them.
  const int id = zone.Subscribe([&](const ZoneEvent&) {
    reader = std::thread([&] { events.set_value(zone.Events(hazard, 10).size()); });
    is_read = read.wait_for(std::chrono::seconds(20)) == std::future_status::ready;
  });
  zone.Handle(MakeReport());
  reader.join();
  zone.Unsubscribe(id);
  EXPECT_TRUE(is_read);
  EXPECT_EQ(read.get(), 2U) << "and sees what was committed";
}

TEST_F(ZoneThreadsTest, TheViewOfBeforeIsHandedOutWhileOneCallerWaitsForANewOne) {
  ZoneService zone(Config(), Clock(), 1);
  zone.Handle(MakeReport());
  ASSERT_TRUE(zone.View());
  SlowCommit commit(zone, Probe());
  std::atomic<int> views{0};
  std::vector<std::thread> callers;
  for (int i = 0; i < 2; ++i) {
    callers.emplace_back([&] { views += zone.View() ? 1 : 0; });
  }
  while (views == 0) std::this_thread::yield();
  EXPECT_TRUE(commit.LetGo());
  for (std::thread& caller : callers) caller.join();
  EXPECT_EQ(views, 2);
}

/// Comes from the south towards `place` and passes it.
void PassBy(ZoneService& zone, const std::string& vehicle, const geo::GeoPoint& place,
            std::atomic<std::int64_t>& now_ns) {
  for (int metres = -200; metres <= -15; metres += 15) {
    now_ns += 1'000'000'000;
    const geo::GeoPoint at{place.latitude_deg + metres / 111000.0, place.longitude_deg};
    zone.UpdateVehicle({vehicle, "", at, 0.0, 15.0, now_ns});
  }
}

TEST_F(ZoneThreadsTest, OfficialsTimeAndAnswersWorkBesideReportsWithoutLosingAnEvent) {
  std::atomic<std::int64_t> now_ns{kNowNs};
  ZoneService zone(
      Config(), [&] { return now_ns.load(); }, 1);
  std::vector<HazardEvent> events;
  const int id = zone.Subscribe([&](const ZoneEvent& event) {
    if (event.hazard) events.push_back(*event.hazard);
  });
  const auto place = [](int i) { return geo::GeoPoint{40 + 0.01 * i, 8}; };
  std::vector<protocol::Report> first;
  for (int i = 0; i < 20; ++i) first.push_back(MakeReport(place(i)));
  zone.HandleBatch(first);
  now_ns += 12 * 3600'000'000'000;

  std::atomic<int> working{3};
  std::thread reporter([&] {
    for (int i = 0; i < 100; ++i) {
      protocol::Report report = MakeReport(place(i % 20));
      report.vehicle_id = "car-" + std::to_string(i);
      report.stamp_ns = now_ns;
      zone.Handle(report);
    }
    --working;
  });
  std::thread official([&] {
    for (int i = 0; i < 40; ++i) {
      for (const Hazard& hazard : zone.Query(std::nullopt, 0, 5)) {
        if (i % 2 == 0) zone.Reject(hazard.uuid, "Anna", "");
        zone.Confirm(hazard.uuid, "Anna");
        EXPECT_FALSE(zone.Events(hazard.uuid, 10).empty());
      }
      zone.Distrust("car-" + std::to_string(2 * i), "Anna", "");
      zone.ChangedAround(place(3), 5000, zone.AnnouncedSequence() / 2, 100);
    }
    --working;
  });
  std::atomic<std::uint64_t> accepted{0};
  std::thread passer([&] {
    for (int i = 0; i < 20; ++i) {
      PassBy(zone, "poll-" + std::to_string(i), place(i), now_ns);
      for (const protocol::Poll& order : zone.TakeDuePolls()) {
        protocol::PollAnswer answer;
        answer.poll = order.poll;
        answer.hazard = order.hazard;
        answer.vehicle_id = order.vehicle_id;
        answer.answer = protocol::PollAnswer::Answer::kNo;
        answer.stamp_ns = now_ns;
        if (zone.HandleAnswer(answer)) ++accepted;
      }
    }
    --working;
  });
  std::thread clock([&] {
    while (working > 0) {
      zone.Advance();
      zone.Statistics();
      std::this_thread::yield();
    }
  });
  for (std::thread* thread : {&reporter, &official, &passer, &clock}) thread->join();
  zone.Unsubscribe(id);

  ASSERT_EQ(events.size(), zone.Sequence());
  std::uint64_t announced = 0;
  for (std::size_t i = 0; i < events.size(); ++i) {
    EXPECT_EQ(events[i].hazard.sequence, i + 1);
    EXPECT_EQ(events[i].previous_announced, announced);
    if (events[i].announced) announced = i + 1;
  }
  EXPECT_EQ(zone.AnnouncedSequence(), announced);
  EXPECT_EQ(zone.Statistics().answers, accepted);
  EXPECT_EQ(zone.Statistics().added + zone.Statistics().merged, 120U);
}

}  // namespace
}  // namespace livemap::zone
