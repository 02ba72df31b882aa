#include "region/zone_follower.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "test/region/told_hazards.h"
#include "test/web/zone_fixture.h"
#include "web/server/web_server.h"

namespace livemap::region {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

const geo::GeoPoint kPlace{40.4433, -79.9436};

/// A real zone with its real server, which can be stopped and come back at the same address.
class RealZone {
 public:
  explicit RealZone(web::WebConfig options = web::TestOptions()) : options_(std::move(options)) {
    Start();
  }

  void Start() {
    server_ = std::make_unique<web::WebServer>(options_, *fixture_->zone, fixture_->catalogue);
    options_.port = server_->port();
  }
  void Stop() { server_.reset(); }
  /// Another zone behind the same address.
  void BeginAnew() {
    Stop();
    fixture_ = std::make_unique<web::ZoneFixture>();
    Start();
  }
  /// The same store in a process that starts.
  web::ZoneFixture& fixture() { return *fixture_; }
  std::string url() const { return "http://127.0.0.1:" + std::to_string(options_.port); }

  /// A pothole that drivers are told of.
  Uuid Add(const geo::GeoPoint& position) {
    const auto receipt = fixture_->zone->Handle(fixture_->MakeReport("pothole", position));
    EXPECT_TRUE(fixture_->zone->Confirm(receipt.hazard_uuid, "miller"));
    return receipt.hazard_uuid;
  }

 private:
  web::WebConfig options_;
  std::unique_ptr<web::ZoneFixture> fixture_ = std::make_unique<web::ZoneFixture>();
  std::unique_ptr<web::WebServer> server_;
};

class ZoneFollowerTest : public testing::Test {
 protected:
  ZoneFollowerTest() { Restart(); }

  /// The region as it is after a start: what it knows is on disk.
  void Restart() {
    follower_.reset();
    map_ = std::make_unique<RegionMap>(zone_.fixture().catalogue, 1000, std::nullopt);
    store_.reset();
    store_ = std::make_unique<RegionStore>(folder_.path() + "/region.sqlite3",
                                           zone_.fixture().catalogue, now_ns_);
    Follow(std::nullopt);
  }
  void Follow(std::optional<directory::ZoneArea> area) {
    follower_ = std::make_unique<ZoneFollower>(
        RegionZone{"north", "", zone_.url(), token_, std::move(area), std::nullopt,
                   with_candidates_},
        [this](const auto& call) {
          urls_.push_back(call.url);
          return client_.Call(call);
        },
        [this] { return now_ns_; }, *map_, *store_);
  }
  void StepToEnd() {
    for (int i = 0; i < 100 && follower_->Step(); ++i) {
    }
  }
  std::vector<zone::Hazard> Listed() const {
    zone::Walk<zone::HazardState> walk;
    walk.states = zone::StatesOnMap();
    return zone::ReadItems(walk, 10000, [this](const auto& where, std::size_t limit) {
      return map_->ReadHazards(where, limit);
    });
  }

  web::TemporaryFolder folder_;
  RealZone zone_;
  std::string token_;
  bool with_candidates_ = false;
  std::int64_t now_ns_ = web::ZoneFixture::kStartNs + 1'000'000'000;
  orders::NetworkClient client_{{"", 5, nullptr}};
  std::vector<std::string> urls_;
  std::unique_ptr<RegionMap> map_;
  std::unique_ptr<RegionStore> store_;
  std::unique_ptr<ZoneFollower> follower_;
};

TEST_F(ZoneFollowerTest, HasWhatAZoneTellsDriversAndFollowsItBySequence) {
  const Uuid first = zone_.Add(kPlace);
  zone_.fixture().zone->Handle(zone_.fixture().MakeReport("debris", {40.45, -79.94}));
  StepToEnd();
  ASSERT_THAT(Listed(), SizeIs(1));
  EXPECT_EQ(Listed()[0].uuid, RegionHazardId("north", first));
  EXPECT_TRUE(follower_->status().is_up);
  EXPECT_EQ(follower_->status().heard_ns, now_ns_);
  EXPECT_EQ(follower_->status().hazards, 1U);

  zone_.Add({40.46, -79.94});
  zone_.fixture().zone->Close(first, "miller");
  const std::uint64_t known = 3;  // Added, confirmed, added.
  urls_.clear();
  StepToEnd();
  ASSERT_THAT(urls_, SizeIs(1));
  EXPECT_THAT(urls_[0], HasSubstr("since=" + std::to_string(known) + "&"));
  ASSERT_THAT(Listed(), SizeIs(1));
  EXPECT_EQ(Listed()[0].position.latitude_deg, 40.46);
  EXPECT_EQ(follower_->status().begun_anew, 0U);
}

TEST_F(ZoneFollowerTest, ReadsCandidatesAnewWhenTheyAreWantedAndLetsGoOfThemAgain) {
  zone_.Add(kPlace);
  zone_.fixture().zone->Handle(zone_.fixture().MakeReport("debris", {40.45, -79.94}));
  StepToEnd();
  EXPECT_THAT(Listed(), SizeIs(1));
  with_candidates_ = true;
  Restart();
  StepToEnd();
  EXPECT_THAT(urls_.back(), HasSubstr("&state=candidate,active,verifying"));
  EXPECT_THAT(Listed(), SizeIs(2));
  EXPECT_EQ(follower_->status().hazards, 1U);
  Restart();
  EXPECT_THAT(Listed(), SizeIs(2)) << "the last state of candidates was not kept";
  with_candidates_ = false;
  Restart();
  EXPECT_THAT(Listed(), SizeIs(1)) << "a candidate is on a map that everybody sees";
  StepToEnd();
  EXPECT_THAT(Listed(), SizeIs(1));
}

TEST_F(ZoneFollowerTest, ReadsAZoneOfManyAnswers) {
  constexpr std::size_t kHazards = 2500;
  zone_.fixture().AddRow("pothole", kPlace, kHazards);
  for (const zone::Hazard& hazard : zone_.fixture().zone->Query(std::nullopt, 0, kHazards)) {
    zone_.fixture().zone->Confirm(hazard.uuid, "miller");
  }
  EXPECT_TRUE(follower_->Step());
  EXPECT_TRUE(follower_->Step());
  EXPECT_FALSE(follower_->Step());
  EXPECT_THAT(Listed(), SizeIs(kHazards));
}

TEST_F(ZoneFollowerTest, AZoneThatIsDownKeepsItsLastStateAlsoInARegionThatStarts) {
  zone_.Add(kPlace);
  StepToEnd();
  const std::int64_t heard_ns = now_ns_;
  zone_.Stop();
  now_ns_ += 3'600'000'000'000;
  EXPECT_FALSE(follower_->Step());
  EXPECT_FALSE(follower_->status().is_up);
  EXPECT_EQ(follower_->status().heard_ns, heard_ns);
  EXPECT_THAT(follower_->status().trouble, HasSubstr("does not answer"));
  EXPECT_EQ(follower_->status().failures, 1U);
  EXPECT_THAT(Listed(), SizeIs(1));

  Restart();
  EXPECT_THAT(Listed(), SizeIs(1));
  EXPECT_FALSE(follower_->status().is_up);
  EXPECT_EQ(follower_->status().heard_ns, heard_ns);
  EXPECT_EQ(follower_->status().hazards, 1U);
}

TEST_F(ZoneFollowerTest, ResumesAfterAnOutageWithoutReadingAllOfItAnew) {
  const Uuid first = zone_.Add(kPlace);
  zone_.Add({40.45, -79.94});
  StepToEnd();
  zone_.Stop();
  follower_->Step();
  zone_.fixture().zone->Close(first, "miller");
  zone_.Start();
  urls_.clear();
  Restart();
  StepToEnd();
  ASSERT_THAT(urls_, SizeIs(1));
  EXPECT_THAT(urls_[0], HasSubstr("since=4&"));
  EXPECT_THAT(Listed(), SizeIs(1));
  EXPECT_TRUE(follower_->status().is_up);
}

TEST_F(ZoneFollowerTest, NoticesAZoneThatBeganAnewAndForgetsWhatItNoLongerHas) {
  zone_.Add(kPlace);
  StepToEnd();
  zone_.BeginAnew();
  // Its ids and its sequence are those of the one before.
  const Uuid other = zone_.Add({40.47, -79.94});
  zone_.Add({40.48, -79.94});
  StepToEnd();
  EXPECT_EQ(follower_->status().begun_anew, 1U);
  ASSERT_THAT(Listed(), SizeIs(2));
  EXPECT_EQ(Listed()[0].position.latitude_deg, 40.47);
  EXPECT_EQ(Listed()[0].uuid, RegionHazardId("north", other));
  Restart();
  EXPECT_THAT(Listed(), SizeIs(2));
  zone_.BeginAnew();
  StepToEnd();
  EXPECT_THAT(Listed(), IsEmpty());
  Restart();
  EXPECT_THAT(Listed(), IsEmpty());
}

TEST_F(ZoneFollowerTest, AHazardFarOutsideOfTheZonesAreaIsLeftOut) {
  Follow(directory::ZoneArea({{{40.4, -80}, {40.4, -79.9}, {40.5, -79.9}, {40.5, -80}}}));
  zone_.Add(kPlace);
  zone_.Add({48, 11});
  StepToEnd();
  EXPECT_THAT(Listed(), SizeIs(1));
  EXPECT_EQ(follower_->status().refused, 1U);
  EXPECT_THAT(follower_->status().refusal, HasSubstr("outside of the zone's area"));
}

TEST_F(ZoneFollowerTest, AnAnswerThatIsNoneChangesNothing) {
  zone_.Add(kPlace);
  StepToEnd();
  std::string body = "<html>";
  ZoneFollower follower(
      {"north", "", zone_.url(), "", std::nullopt},
      [&](const auto&) {
        orders::HttpAnswer answer;
        answer.status = 200;
        answer.body = body;
        return answer;
      },
      [this] { return now_ns_; }, *map_, *store_);
  EXPECT_FALSE(follower.Step());
  EXPECT_FALSE(follower.status().is_up);
  EXPECT_THAT(follower.status().trouble, HasSubstr("no JSON"));
  EXPECT_THAT(Listed(), SizeIs(1));
}

TEST(ZoneFollowerToken, IsShownToAZoneThatHidesItsHazards) {
  const web::TokenFile tokens;
  web::WebConfig options = web::TestOptions();
  options.token_file = tokens.path();
  options.public_sees = web::PublicSees::kNothing;
  const web::TemporaryFolder folder;
  options.accounts_file = folder.path() + "/accounts.sqlite3";
  {
    accounts::AccountStore accounts(options.accounts_file, {});
    accounts.Add("root", accounts::Role::kAdmin, "a long enough password", 1);
  }
  RealZone zone(options);
  zone.Add(kPlace);
  RegionMap map(zone.fixture().catalogue, 0, std::nullopt);
  RegionStore store(folder.path() + "/region.sqlite3", zone.fixture().catalogue, kNowNs);
  const orders::NetworkClient client({"", 5, nullptr});
  const auto call = [&](const auto& question) { return client.Call(question); };
  ZoneFollower stranger(
      {"north", "", zone.url(), "", std::nullopt}, call, [] { return kNowNs + 1; }, map, store);
  stranger.Step();
  EXPECT_THAT(stranger.status().trouble, HasSubstr("logged in"));
  EXPECT_EQ(map.CountOf("north"), 0U);
  ZoneFollower trusted(
      {"north", "", zone.url(), web::TokenFile::token(), std::nullopt}, call,
      [] { return kNowNs + 1; }, map, store);
  trusted.Step();
  EXPECT_TRUE(trusted.status().is_up) << trusted.status().trouble;
  EXPECT_EQ(map.CountOf("north"), 1U);
}

}  // namespace
}  // namespace livemap::region
