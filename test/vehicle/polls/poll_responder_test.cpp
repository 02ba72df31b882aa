#include "vehicle/polls/poll_responder.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <utility>

#include "test/vehicle/reporting/driving_reporter.h"

namespace livemap::vehicle {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;
using AnswerKind = protocol::PollAnswer::Answer;

/// base_link at a moment of the straight drive, known to 0.2 m and 0.01 rad.
geo::TrackPose BaseAt(double seconds) {
  geo::TrackPose pose;
  pose.position = VehicleAt(seconds);
  pose.covariance_m2 = 0.04 * Eigen::Matrix2d::Identity();
  pose.course_rad = kBearingRad;
  pose.course_variance_rad2 = 1e-4;
  pose.speed_mps = kSpeedMps;
  return pose;
}

imaging::Picture Lit(double luminance) {
  return {cv::Mat(400, 640, CV_8UC3, cv::Scalar::all(luminance)), nullptr};
}

/// The vehicle drives at 16 m/s past a place that lies 60 m ahead of its start, 1.5 m to the right.
class PollResponderTest : public ::testing::Test {
 protected:
  static constexpr double kAheadM = 60;
  static constexpr double kRightM = 1.5;

  PollResponderTest() : responder_(Configured(), protocol::HazardCatalogue()) {
    poll_.poll = Named(1);
    poll_.hazard = Named(2);
    poll_.stamp_ns = 50'000'000'000;  // The zone's clock is another one.
    poll_.expires_ns = poll_.stamp_ns + 60'000'000'000;
    poll_.class_name = "pothole";
    poll_.position = PlaceAt(kAheadM, kRightM);
    poll_.covariance_m2 = 0.09 * Eigen::Matrix2d::Identity();
    vehicle_.intrinsics = Intrinsics();
    vehicle_.mounting = [](const std::string& frame_id) {
      return frame_id == kOptical ? std::optional<Eigen::Isometry3d>(Mounting()) : std::nullopt;
    };
    vehicle_.pose_at = [](std::int64_t stamp_ns, double) {
      const double seconds = static_cast<double>(stamp_ns - kEpochNs) * 1e-9;
      return VehiclePoseLookup::Lookup{VehiclePoseLookup::Answer::kReady, BaseAt(seconds)};
    };
    vehicle_.image_at = [](std::int64_t) { return GreyImage(); };
  }

  static PollResponder::Config Configured() {
    PollResponder::Config config;
    config.drive_id = "drive-1";
    return config;
  }
  static Uuid Named(int number) {
    Uuid id;
    id.bytes[15] = static_cast<std::uint8_t>(number);
    return id;
  }
  static geo::GeoPoint PlaceAt(double ahead_m, double right_m) {
    return geo::GeodesicDestination(geo::GeodesicDestination(kStart, kBearingRad, ahead_m),
                                    kBearingRad + M_PI / 2, right_m);
  }

  /// The box of the hazard at the place as the camera sees it at that moment.
  static imaging::Box BoxOfPlace(double seconds, double ahead_m = kAheadM) {
    return BoxAt(ahead_m - kSpeedMps * seconds, -kRightM);
  }

  /// Frames at 10 Hz; `seen` says what the detector finds in each.
  void Drive(double from_s, double to_s,
             const std::function<std::vector<placement::Sighting>(double)>& seen = {}) {
    for (double time_s = from_s; time_s <= to_s; time_s += 0.1) {
      if (luminance_) {
        responder_.AddLuminance(StampNs(time_s),
                                PollResponder::MeanLuminance(Lit(*luminance_).bgr));
      }
      responder_.AddFrame(FrameAt(time_s, seen ? seen(time_s) : std::vector<placement::Sighting>{}),
                          time_s);
      steady_s_ += 0.1;
      responder_.Process(time_s, steady_s_, vehicle_);
      if (makes_pictures_) MakePictures(time_s);
    }
  }

  /// Answers the responder's orders; the image has nobody to mask.
  void MakePictures(double time_s) {
    for (const PictureOrder& order : responder_.TakePictureOrders()) {
      responder_.AddPictures(order.number, CutPictures(order, order.image.picture.bgr, false));
    }
    responder_.Process(time_s, steady_s_, vehicle_);
  }
  void Expire() {
    steady_s_ += 60;
    responder_.Process(1000, steady_s_, vehicle_);
  }
  protocol::PollAnswer OnlyReply() {
    const auto replies = responder_.TakeReplies();
    EXPECT_THAT(replies, SizeIs(1));
    return replies.empty() ? protocol::PollAnswer{} : replies[0];
  }

  PollResponder responder_;
  PollResponder::Vehicle vehicle_;
  protocol::Poll poll_;
  std::optional<double> luminance_ = 100;
  bool makes_pictures_ = true;
  double steady_s_ = 10;
};

TEST_F(PollResponderTest, SaysYesAtOnceWhenTheDetectorSeesTheHazardAtItsPlace) {
  poll_.picture = protocol::PollPicture::kFullFrame;
  poll_.max_picture_bytes = 30000;
  responder_.Add(poll_, steady_s_);
  Drive(2.0, 2.8, [](double time_s) {
    return time_s < 2.65 ? std::vector<placement::Sighting>{}
                         : std::vector<placement::Sighting>{{"pothole", 0.7F, BoxOfPlace(time_s)}};
  });
  const protocol::PollAnswer reply = OnlyReply();
  EXPECT_EQ(reply.answer, AnswerKind::kYes);
  EXPECT_EQ(reply.poll, poll_.poll);
  EXPECT_EQ(reply.hazard, poll_.hazard);
  EXPECT_EQ(reply.drive_id, "drive-1");
  EXPECT_EQ(reply.confidence, 0.7F);
  EXPECT_NEAR(static_cast<double>(reply.stamp_ns - kEpochNs) * 1e-9, 2.7, 0.01) << "its image's";
  EXPECT_LT(geo::GeodesicDistanceM(reply.vehicle_position, VehicleAt(2.7)), 0.1);
  EXPECT_EQ(reply.image_format, "jpeg");
  EXPECT_LE(reply.image.size(), 30000u);
  EXPECT_EQ(cv::imdecode(reply.image, cv::IMREAD_COLOR).size(), cv::Size(640, 400));
  EXPECT_EQ(responder_.open(), 0u);
}

TEST_F(PollResponderTest, SaysNoWhenThePlaceWasWellInViewSeveralTimesAndNothingWasThere) {
  responder_.Add(poll_, steady_s_);
  Drive(2.0, 4.0);
  const protocol::PollAnswer reply = OnlyReply();
  EXPECT_EQ(reply.answer, AnswerKind::kNo);
  EXPECT_GT(reply.confidence, 0.9F);
  EXPECT_THAT(reply.image, IsEmpty()) << "none was wanted";
  const double distance_m = geo::GeodesicDistanceM(reply.vehicle_position, poll_.position);
  EXPECT_LT(distance_m, 14) << "the nearest view speaks";
}

/// Change detection's word on a place beside the one asked about.
ChangeEvidence Changed(const geo::GeoPoint& position, bool vanished,
                       const std::string& change_class) {
  ChangeEvidence evidence;
  evidence.change_class = change_class;
  evidence.vanished = vanished;
  evidence.position = position;
  evidence.covariance_m2 = 0.25 * Eigen::Matrix2d::Identity();
  evidence.confidence = 0.8F;
  return evidence;
}

TEST_F(PollResponderTest, OneClearViewIsEnoughWhereChangeDetectionKnowsThatItWent) {
  poll_.class_name = "road_work_sign";
  responder_.Add(poll_, steady_s_);
  // Just within range; the drive ends before a second view counts.
  Drive(2.55, 2.65);
  responder_.AddChange(Changed(PlaceAt(kAheadM + 1, kRightM), true, "sign"));
  Expire();
  const protocol::PollAnswer reply = OnlyReply();
  EXPECT_EQ(reply.answer, AnswerKind::kNo);
  EXPECT_NEAR(reply.confidence, 0.8, 0.1);
  EXPECT_EQ(responder_.counters().no_by_change, 1U);
}

TEST_F(PollResponderTest, ChangesOfOtherClassesOrPlacesSayNothing) {
  poll_.class_name = "road_work_sign";
  responder_.Add(poll_, steady_s_);
  Drive(2.55, 2.65);
  responder_.AddChange(Changed(PlaceAt(kAheadM, kRightM), true, "vehicle"));
  responder_.AddChange(Changed(PlaceAt(kAheadM + 30, kRightM), true, "sign"));
  ChangeEvidence unsound = Changed(PlaceAt(kAheadM, kRightM), true, "sign");
  unsound.confidence = std::nanf("");
  responder_.AddChange(unsound);
  Expire();
  EXPECT_EQ(OnlyReply().answer, AnswerKind::kCantSee);
}

TEST_F(PollResponderTest, WithoutAClearViewAChangeAloneIsNoAnswer) {
  poll_.class_name = "barrier";
  responder_.Add(poll_, steady_s_);
  Drive(0, 0.3);
  responder_.AddChange(Changed(poll_.position, true, "barrier"));
  Expire();
  EXPECT_EQ(OnlyReply().answer, AnswerKind::kCantSee);
}

TEST_F(PollResponderTest, NothingIsDeniedWhereChangeDetectionSawThatItCame) {
  poll_.class_name = "barrier";
  responder_.Add(poll_, steady_s_);
  responder_.AddChange(Changed(poll_.position, false, "barrier"));
  Drive(2.0, 4.0);
  Expire();
  const protocol::PollAnswer reply = OnlyReply();
  EXPECT_EQ(reply.answer, AnswerKind::kCantSee);
  EXPECT_THAT(reply.reason, HasSubstr("not detected"));
  EXPECT_EQ(responder_.counters().disagreed, 1U);
}

TEST_F(PollResponderTest, WhatTheDetectorSeesIsThereWhateverChangeDetectionSays) {
  poll_.class_name = "barrier";
  responder_.Add(poll_, steady_s_);
  responder_.AddChange(Changed(poll_.position, true, "barrier"));
  Drive(2.6, 2.8, [](double time_s) {
    return std::vector<placement::Sighting>{{"barrier", 0.7F, BoxOfPlace(time_s)}};
  });
  EXPECT_EQ(OnlyReply().answer, AnswerKind::kYes);
}

TEST(MayBe, AThingOfNoCertainClassMayBeAnyHazardButAPothole) {
  EXPECT_TRUE(MayBe("sign", "road_work_sign"));
  EXPECT_FALSE(MayBe("sign", "barrier"));
  EXPECT_TRUE(MayBe("other_objects", "barrier"));
  EXPECT_FALSE(MayBe("other_objects", "pothole"));
  EXPECT_FALSE(MayBe("person_cycle", "deer"));
}

TEST_F(PollResponderTest, AnImageWaitsUntilTheCameraIsKnown) {
  const auto intrinsics = std::exchange(vehicle_.intrinsics, std::nullopt);
  responder_.Add(poll_, steady_s_);
  Drive(2.7, 2.75, [](double time_s) {
    return std::vector<placement::Sighting>{{"pothole", 0.7F, BoxOfPlace(time_s)}};
  });
  EXPECT_THAT(responder_.TakeReplies(), IsEmpty());
  vehicle_.intrinsics = intrinsics;
  responder_.Process(2.8, steady_s_, vehicle_);
  EXPECT_EQ(OnlyReply().answer, AnswerKind::kYes);
}

TEST_F(PollResponderTest, AnotherClassOrAnotherPlaceIsNoYes) {
  responder_.Add(poll_, steady_s_);
  Drive(2.0, 4.0, [](double time_s) {
    return std::vector<placement::Sighting>{{"deer", 0.9F, BoxOfPlace(time_s)},
                                            {"pothole", 0.9F, BoxOfPlace(time_s, kAheadM + 12)}};
  });
  EXPECT_EQ(OnlyReply().answer, AnswerKind::kNo);
}

TEST_F(PollResponderTest, ADetectionFarAwayIsAYesAlthoughNothingThereWouldBeNoNo) {
  responder_.Add(poll_, steady_s_);
  const auto seen = [](double time_s) {
    return std::vector<placement::Sighting>{{"pothole", 0.6F, BoxOfPlace(time_s)}};
  };
  Drive(1.0, 1.05, seen);
  EXPECT_THAT(responder_.TakeReplies(), IsEmpty()) << "at 44 m it could be another one";
  Drive(2.25, 2.3, seen);
  EXPECT_EQ(OnlyReply().answer, AnswerKind::kYes) << "at 24 m";
}

TEST_F(PollResponderTest, CantSeeTellsWhenChangeDetectionRecognisedNothing) {
  vehicle_.pose_at = [](std::int64_t, double) {
    return VehiclePoseLookup::Lookup{VehiclePoseLookup::Answer::kReady, BaseAt(2.8)};
  };
  responder_.AddUnregistered();  // Before the poll: not of its place.
  responder_.Add(poll_, steady_s_);
  Drive(2.8, 4.0);
  responder_.AddUnregistered();
  Drive(4.0, 8.0);
  Expire();
  const protocol::PollAnswer reply = OnlyReply();
  EXPECT_EQ(reply.answer, AnswerKind::kCantSee);
  EXPECT_THAT(reply.reason, HasSubstr("unregistered"));
}

TEST_F(PollResponderTest, FramesAtRestAreOneView) {
  vehicle_.pose_at = [](std::int64_t, double) {
    return VehiclePoseLookup::Lookup{VehiclePoseLookup::Answer::kReady, BaseAt(2.8)};
  };
  responder_.Add(poll_, steady_s_);
  Drive(2.8, 8.0);
  EXPECT_THAT(responder_.TakeReplies(), IsEmpty());
  Expire();
  const protocol::PollAnswer reply = OnlyReply();
  EXPECT_EQ(reply.answer, AnswerKind::kCantSee);
  EXPECT_EQ(reply.reason, "the place was in view too few times");
}

TEST_F(PollResponderTest, CannotSeeWhatIsTooFarAwayOrNeverInTheImage) {
  responder_.Add(poll_, steady_s_);
  Drive(0, 1.0);
  Expire();
  EXPECT_THAT(OnlyReply().reason, HasSubstr("too far"));

  poll_.poll = Named(3);
  poll_.position = PlaceAt(kAheadM, 19);
  responder_.Add(poll_, steady_s_);
  Drive(2.8, 4.5);
  Expire();
  const protocol::PollAnswer reply = OnlyReply();
  EXPECT_EQ(reply.answer, AnswerKind::kCantSee);
  EXPECT_THAT(reply.reason, HasSubstr("out of the camera's view"));
  EXPECT_NEAR(static_cast<double>(reply.stamp_ns - kEpochNs) * 1e-9, 4.5, 0.11) << "the last image";
}

TEST_F(PollResponderTest, CannotSeeInTheDark) {
  luminance_ = 8;
  responder_.Add(poll_, steady_s_);
  Drive(2.6, 3.3);
  Expire();
  EXPECT_EQ(OnlyReply().reason, "too dark");
}

TEST_F(PollResponderTest, SaysNothingWithoutAnyPositionAndCannotSeeWithoutThoseOfTheImages) {
  const auto known = vehicle_.pose_at;
  vehicle_.pose_at = [](std::int64_t, double) { return VehiclePoseLookup::Lookup{}; };
  responder_.Add(poll_, steady_s_);
  Drive(2.0, 4.0);
  responder_.Process(10, steady_s_, vehicle_);
  Expire();
  EXPECT_THAT(responder_.TakeReplies(), IsEmpty());
  EXPECT_EQ(responder_.counters().unanswered, 1u);

  vehicle_.pose_at = known;
  poll_.poll = Named(3);
  responder_.Add(poll_, steady_s_);
  Drive(0, 0.05);
  vehicle_.pose_at = [](std::int64_t, double) {
    return VehiclePoseLookup::Lookup{VehiclePoseLookup::Answer::kHopeless, {}};
  };
  Drive(2.0, 4.0);
  Expire();
  EXPECT_EQ(OnlyReply().reason, "no position of the vehicle");
}

TEST_F(PollResponderTest, APoorPositionMakesNoNo) {
  vehicle_.pose_at = [](std::int64_t stamp_ns, double) {
    geo::TrackPose pose = BaseAt(static_cast<double>(stamp_ns - kEpochNs) * 1e-9);
    pose.covariance_m2 = 64 * Eigen::Matrix2d::Identity();
    return VehiclePoseLookup::Lookup{VehiclePoseLookup::Answer::kReady, pose};
  };
  responder_.Add(poll_, steady_s_);
  Drive(2.0, 4.0);
  Expire();
  EXPECT_EQ(OnlyReply().answer, AnswerKind::kCantSee) << "8 m: who knows where it looked";
}

TEST_F(PollResponderTest, ARepeatedPollIsAnsweredOnceAndTooManyAreNotTaken) {
  responder_.Add(poll_, steady_s_);
  responder_.Add(poll_, steady_s_);
  Drive(2.0, 4.0);
  EXPECT_THAT(responder_.TakeReplies(), SizeIs(1));
  responder_.Add(poll_, steady_s_);
  EXPECT_EQ(responder_.counters().repeated, 2u);
  EXPECT_EQ(responder_.open(), 0u);
  for (int i = 10; i < 40; ++i) {
    poll_.poll = Named(i);
    responder_.Add(poll_, steady_s_);
  }
  EXPECT_EQ(responder_.open(), 16u);
  EXPECT_EQ(responder_.counters().not_taken, 14u);
}

TEST_F(PollResponderTest, APollThatIsOverOrNeverEndsDoesNotStay) {
  poll_.expires_ns = poll_.stamp_ns + 1'000'000'000;
  responder_.Add(poll_, steady_s_);
  EXPECT_EQ(responder_.counters().not_taken, 1u) << "no time is left to look";
  poll_.poll = Named(3);
  poll_.expires_ns = std::numeric_limits<std::int64_t>::max();
  responder_.Add(poll_, steady_s_);
  Drive(0, 0.05);
  steady_s_ += responder_.config().max_life_s;
  responder_.Process(5000, steady_s_, vehicle_);
  EXPECT_THAT(responder_.TakeReplies(), SizeIs(1));
}

TEST_F(PollResponderTest, AYesWaitsShortlyForItsImageAndThenGoesWithoutAPicture) {
  vehicle_.image_at = [](std::int64_t) { return CameraImage{}; };
  poll_.picture = protocol::PollPicture::kFullFrame;
  poll_.max_picture_bytes = 30000;
  responder_.Add(poll_, steady_s_);
  const auto seen = [](double time_s) {
    return std::vector<placement::Sighting>{{"pothole", 0.7F, BoxOfPlace(time_s)}};
  };
  Drive(2.7, 2.75, seen);
  EXPECT_THAT(responder_.TakeReplies(), IsEmpty());
  steady_s_ += responder_.config().image_wait_s;
  responder_.Process(2.8, steady_s_, vehicle_);
  EXPECT_THAT(OnlyReply().image, IsEmpty());
}

TEST_F(PollResponderTest, AnOrderThatIsAnsweredWithNothingMakesAnAnswerWithoutPicture) {
  makes_pictures_ = false;
  poll_.picture = protocol::PollPicture::kFullFrame;
  poll_.max_picture_bytes = 30000;
  responder_.Add(poll_, steady_s_);
  Drive(2.7, 2.75, [](double time_s) {
    return std::vector<placement::Sighting>{{"pothole", 0.7F, BoxOfPlace(time_s)}};
  });
  const std::vector<PictureOrder> orders = responder_.TakePictureOrders();
  ASSERT_THAT(orders, SizeIs(1));
  EXPECT_THAT(responder_.TakeReplies(), IsEmpty()) << "it waits for the answer";
  responder_.AddPictures(orders[0].number, {});
  responder_.Process(2.8, steady_s_, vehicle_);
  const protocol::PollAnswer reply = OnlyReply();
  EXPECT_EQ(reply.answer, AnswerKind::kYes);
  EXPECT_THAT(reply.image, IsEmpty());
  EXPECT_EQ(reply.image_format, "");
}

TEST_F(PollResponderTest, ANoWithAPictureIsDecidedSoEarlyThatThePictureCanBeMadeInTime) {
  makes_pictures_ = false;
  vehicle_.pose_at = [](std::int64_t stamp_ns, double) {
    // It comes to rest before the place: that never leaves the view.
    const double seconds = static_cast<double>(stamp_ns - kEpochNs) * 1e-9;
    return VehiclePoseLookup::Lookup{VehiclePoseLookup::Answer::kReady,
                                     BaseAt(std::min(seconds, 3.0))};
  };
  poll_.picture = protocol::PollPicture::kFullFrame;
  poll_.max_picture_bytes = 30000;
  const double begin_s = steady_s_;
  responder_.Add(poll_, steady_s_);
  Drive(2.5, 3.2);
  const double answer_by_s = begin_s + 60 - responder_.config().reserve_s;
  responder_.Process(3, answer_by_s - responder_.config().picture_wait_s - 0.01, vehicle_);
  EXPECT_THAT(responder_.TakePictureOrders(), IsEmpty()) << "nearer views may come";
  responder_.Process(3, answer_by_s - responder_.config().picture_wait_s + 0.01, vehicle_);
  const std::vector<PictureOrder> orders = responder_.TakePictureOrders();
  ASSERT_THAT(orders, SizeIs(1));
  responder_.AddPictures(orders[0].number,
                         CutPictures(orders[0], orders[0].image.picture.bgr, false));
  responder_.Process(3, answer_by_s - 0.01, vehicle_);
  const protocol::PollAnswer reply = OnlyReply();
  EXPECT_EQ(reply.answer, AnswerKind::kNo);
  EXPECT_FALSE(reply.image.empty());
}

TEST_F(PollResponderTest, AnAnswerLeavesInTimeThoughItsPictureIsNotMadeYet) {
  makes_pictures_ = false;
  poll_.picture = protocol::PollPicture::kFullFrame;
  poll_.max_picture_bytes = 30000;
  responder_.Add(poll_, steady_s_);
  const double answer_by_s = steady_s_ + 60 - responder_.config().reserve_s;
  Drive(2.7, 2.75, [](double time_s) {
    return std::vector<placement::Sighting>{{"pothole", 0.7F, BoxOfPlace(time_s)}};
  });
  ASSERT_THAT(responder_.TakePictureOrders(), SizeIs(1));
  responder_.Process(3, answer_by_s - 0.01, vehicle_);
  EXPECT_THAT(responder_.TakeReplies(), IsEmpty());
  responder_.Process(3, answer_by_s + 0.01, vehicle_);
  const protocol::PollAnswer reply = OnlyReply();
  EXPECT_EQ(reply.answer, AnswerKind::kYes);
  EXPECT_THAT(reply.image, IsEmpty());
}

TEST_F(PollResponderTest, AnAnswerWhosePictureIsBeingMadeStandsWhateverChangeDetectionSays) {
  makes_pictures_ = false;
  poll_.class_name = "barrier";
  poll_.picture = protocol::PollPicture::kFullFrame;
  poll_.max_picture_bytes = 30000;
  responder_.Add(poll_, steady_s_);
  Drive(2.0, 4.0);
  const std::vector<PictureOrder> orders = responder_.TakePictureOrders();
  ASSERT_THAT(orders, SizeIs(1));
  responder_.AddChange(Changed(poll_.position, false, "barrier"));
  responder_.AddPictures(orders[0].number,
                         CutPictures(orders[0], orders[0].image.picture.bgr, false));
  responder_.Process(4.1, steady_s_, vehicle_);
  const protocol::PollAnswer reply = OnlyReply();
  EXPECT_EQ(reply.answer, AnswerKind::kNo);
  EXPECT_FALSE(reply.image.empty());
}

TEST_F(PollResponderTest, TheCropShowsThePlaceWithinTheSmallerOfBothBudgets) {
  poll_.picture = protocol::PollPicture::kCrop;
  poll_.max_picture_bytes = 30000;
  responder_.Add(poll_, steady_s_);
  Drive(2.7, 2.75, [](double time_s) {
    return std::vector<placement::Sighting>{{"pothole", 0.7F, BoxOfPlace(time_s)}};
  });
  const protocol::PollAnswer reply = OnlyReply();
  EXPECT_EQ(cv::imdecode(reply.image, cv::IMREAD_COLOR).size(), cv::Size(480, 320));
  EXPECT_LE(reply.image.size(), responder_.config().crop.max_bytes);
}

TEST_F(PollResponderTest, AWholeFrameShowsAllOfTheImageWithinTheSmallerOfBothBudgets) {
  const auto seen = [](double time_s) {
    return std::vector<placement::Sighting>{{"pothole", 0.7F, BoxOfPlace(time_s)}};
  };
  poll_.picture = protocol::PollPicture::kFullFrame;
  for (const std::uint32_t zone_bytes : {30000U, 4'000'000'000U}) {
    poll_.poll = Named(static_cast<int>(zone_bytes % 97));
    poll_.max_picture_bytes = zone_bytes;
    responder_.Add(poll_, steady_s_);
    Drive(2.7, 2.75, seen);
    const std::vector<std::uint8_t> picture = OnlyReply().image;
    EXPECT_EQ(cv::imdecode(picture, cv::IMREAD_COLOR).size(), cv::Size(640, 400)) << zone_bytes;
    EXPECT_LE(picture.size(), std::min<std::size_t>(zone_bytes, 100000));
  }
}

TEST_F(PollResponderTest, WhoAsksForAWholeFrameIsShownWhatWasNotRecognised) {
  makes_pictures_ = false;
  poll_.picture = protocol::PollPicture::kFullFrame;
  poll_.max_picture_bytes = 30000;
  responder_.Add(poll_, steady_s_);
  // One clear view, then the place has left the camera's view: too few for a no.
  Drive(2.6, 2.65);
  Drive(6.0, 6.05);
  const std::vector<PictureOrder> orders = responder_.TakePictureOrders();
  ASSERT_THAT(orders, SizeIs(1));
  EXPECT_EQ(orders[0].cuts.at(0).label, "pothole not found");
  responder_.AddPictures(orders[0].number,
                         CutPictures(orders[0], orders[0].image.picture.bgr, false));
  responder_.Process(6.1, steady_s_, vehicle_);
  const protocol::PollAnswer reply = OnlyReply();
  EXPECT_EQ(reply.answer, AnswerKind::kCantSee);
  EXPECT_EQ(reply.reason, "the place was in view too few times");
  EXPECT_FALSE(reply.image.empty());
  EXPECT_EQ(reply.stamp_ns, StampNs(2.6)) << "of the picture's image";
}

TEST_F(PollResponderTest, AYesFromAfarWaitsForANearerWholeFrame) {
  const auto seen = [](double time_s) {
    return std::vector<placement::Sighting>{{"pothole", 0.7F, BoxOfPlace(time_s)}};
  };
  poll_.picture = protocol::PollPicture::kFullFrame;
  poll_.max_picture_bytes = 30000;
  responder_.Add(poll_, steady_s_);
  Drive(2.2, 2.25, seen);
  EXPECT_THAT(responder_.TakeReplies(), IsEmpty()) << "25 m away";
  Drive(2.7, 2.75, seen);
  protocol::PollAnswer reply = OnlyReply();
  EXPECT_EQ(reply.answer, AnswerKind::kYes);
  EXPECT_EQ(reply.stamp_ns, StampNs(2.7));
  // Without a nearer view the far one has to do.
  poll_.poll = Named(7);
  responder_.Add(poll_, steady_s_);
  Drive(2.2, 2.25, seen);
  Drive(6.0, 6.05);
  reply = OnlyReply();
  EXPECT_EQ(reply.answer, AnswerKind::kYes);
  EXPECT_EQ(reply.stamp_ns, StampNs(2.2));
  EXPECT_THAT(reply.image, Not(IsEmpty()));
}

TEST_F(PollResponderTest, APlaceThatWasNeverInAClearViewMakesNoWholeFrame) {
  poll_.picture = protocol::PollPicture::kFullFrame;
  poll_.max_picture_bytes = 30000;
  responder_.Add(poll_, steady_s_);
  Drive(6.0, 6.5);
  Expire();
  const protocol::PollAnswer reply = OnlyReply();
  EXPECT_EQ(reply.answer, AnswerKind::kCantSee);
  EXPECT_THAT(reply.image, IsEmpty());
}

TEST_F(PollResponderTest, APictureIsOrderedOnceWhenTheAnswerStandsAlsoForANo) {
  makes_pictures_ = false;
  poll_.picture = protocol::PollPicture::kCrop;
  poll_.max_picture_bytes = 12000;
  responder_.Add(poll_, steady_s_);
  // Which image it is, by its brightness.
  vehicle_.image_at = [](std::int64_t stamp_ns) {
    return CameraImage{Lit(static_cast<double>((stamp_ns - kEpochNs) / 100'000'000)), {}};
  };
  Drive(2.0, 4.0);
  const std::vector<PictureOrder> orders = responder_.TakePictureOrders();
  ASSERT_THAT(orders, SizeIs(1)) << "once, though several views counted";
  responder_.AddPictures(orders[0].number,
                         CutPictures(orders[0], orders[0].image.picture.bgr, false));
  responder_.Process(4.1, steady_s_, vehicle_);
  const protocol::PollAnswer reply = OnlyReply();
  EXPECT_EQ(reply.answer, AnswerKind::kNo);
  const cv::Mat shown = cv::imdecode(reply.image, cv::IMREAD_COLOR);
  EXPECT_NEAR(shown.at<cv::Vec3b>(0, 0)[0],
              static_cast<double>((reply.stamp_ns - kEpochNs) / 100'000'000), 1)
      << "the picture of the image that speaks for the answer";
  EXPECT_GE(shown.cols, 480);
  EXPECT_LT(shown.cols, 640) << "not the whole image";
}

TEST_F(PollResponderTest, BrightnessAloneTellsThatItIsTooDark) {
  luminance_.reset();
  responder_.Add(poll_, steady_s_);
  for (double time_s = 2.0; time_s <= 4.0; time_s += 0.1) {
    responder_.AddLuminance(StampNs(time_s), 5);
    Drive(time_s, time_s + 0.05);
  }
  Expire();
  EXPECT_EQ(OnlyReply().reason, "too dark");
}

TEST_F(PollResponderTest, FramesOfAnotherCameraOrSizeAreNoViews) {
  responder_.Add(poll_, steady_s_);
  vehicle_.intrinsics->width = 1280;
  Drive(2.0, 4.0);
  Expire();
  EXPECT_EQ(OnlyReply().reason, "no calibrated camera");
}

}  // namespace
}  // namespace livemap::vehicle
