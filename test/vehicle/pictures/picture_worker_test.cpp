#include "vehicle/pictures/picture_worker.h"

#include <gmock/gmock.h>

#include <future>
#include <stdexcept>
#include <thread>

namespace livemap::vehicle {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using Pictures = std::vector<imaging::CroppedPicture>;

PictureOrder Numbered(std::uint64_t number) {
  PictureOrder order;
  order.number = number;
  order.image.picture.bgr = cv::Mat(8, 8, CV_8UC3, cv::Scalar::all(9));
  order.cuts.resize(1);
  return order;
}

/// Whose file is the order's number.
Pictures PictureOf(const PictureOrder& order) {
  imaging::CroppedPicture picture;
  picture.jpeg = {static_cast<std::uint8_t>(order.number)};
  return {picture};
}

/// A worker whose maker does one order after the other as it is let, and what it answered.
class PictureWorkerTest : public ::testing::Test {
 protected:
  ~PictureWorkerTest() override { LetGo(); }

  void Start(const PictureWorker::Config& config, PictureWorker::Make make = PictureOf) {
    worker_ = std::make_unique<PictureWorker>(config, [this, make](const PictureOrder& order) {
      started_.set_value();
      gate_.wait();
      started_ = std::promise<void>();
      return make(order);
    });
  }
  void LetGo() {
    if (!is_open_) open_gate_.set_value();
    is_open_ = true;
  }
  void Order(std::uint64_t number, double steady_s) {
    worker_->Order(Numbered(number), steady_s, [this, number](Pictures pictures) {
      answers_.emplace_back(number, pictures.empty() ? 0 : int{pictures[0].jpeg.at(0)});
    });
  }
  /// Until nothing is open; a test that hangs here has found a fault.
  void DeliverAll(double steady_s) {
    while (worker_->open() > 0) {
      worker_->Deliver(steady_s);
      std::this_thread::yield();
    }
  }

  std::promise<void> open_gate_;
  std::shared_future<void> gate_ = open_gate_.get_future().share();
  bool is_open_ = false;
  std::promise<void> started_;
  std::vector<std::pair<std::uint64_t, int>> answers_;
  std::unique_ptr<PictureWorker> worker_;
};

TEST_F(PictureWorkerTest, AnswersEveryOrderInTheirOrder) {
  LetGo();
  Start({});
  for (std::uint64_t number = 1; number <= 5; ++number) Order(number, 10);
  EXPECT_THAT(answers_, IsEmpty()) << "not before Deliver";
  DeliverAll(10);
  using Answer = std::pair<std::uint64_t, int>;
  EXPECT_THAT(answers_,
              ElementsAre(Answer{1, 1}, Answer{2, 2}, Answer{3, 3}, Answer{4, 4}, Answer{5, 5}));
  EXPECT_EQ(worker_->counters().made, 5u);
}

TEST_F(PictureWorkerTest, AFullQueueRefusesTheNewestAtOnce) {
  PictureWorker::Config config;
  config.max_waiting = 2;
  Start(config);
  const std::future<void> started = started_.get_future();
  Order(1, 10);
  started.wait();  // In work; the queue is empty.
  for (std::uint64_t number = 2; number <= 4; ++number) Order(number, 10);
  worker_->Deliver(10);
  EXPECT_THAT(answers_, ElementsAre(std::pair<std::uint64_t, int>{4, 0}));
  EXPECT_EQ(worker_->counters().refused, 1u);
  LetGo();
  DeliverAll(10);
  EXPECT_THAT(answers_, SizeIs(4));
  EXPECT_EQ(worker_->counters().made, 3u);
}

TEST_F(PictureWorkerTest, AMakerThatHangsHoldsNoAnswerBackBeyondTheWait) {
  PictureWorker::Config config;
  config.max_wait_s = 3;
  Start(config);
  const std::future<void> started = started_.get_future();
  Order(1, 10);
  started.wait();
  Order(2, 11);
  worker_->Deliver(12.9);
  EXPECT_THAT(answers_, IsEmpty());
  using Answer = std::pair<std::uint64_t, int>;
  worker_->Deliver(13);
  EXPECT_THAT(answers_, ElementsAre(Answer{1, 0}));
  worker_->Deliver(14);
  EXPECT_THAT(answers_, ElementsAre(Answer{1, 0}, Answer{2, 0})) << "it never began";
  EXPECT_EQ(worker_->counters().late, 2u);
  LetGo();
  Order(3, 20);
  DeliverAll(20);
  EXPECT_THAT(answers_, ElementsAre(Answer{1, 0}, Answer{2, 0}, Answer{3, 3}))
      << "what came too late is answered once";
}

TEST_F(PictureWorkerTest, AMakerThatThrowsMakesNoPicture) {
  LetGo();
  Start({}, [](const PictureOrder& order) -> Pictures {
    if (order.number == 1) throw std::runtime_error("no memory");
    return PictureOf(order);
  });
  Order(1, 10);
  Order(2, 10);
  DeliverAll(10);
  using Answer = std::pair<std::uint64_t, int>;
  EXPECT_THAT(answers_, ElementsAre(Answer{1, 0}, Answer{2, 2}));
}

TEST_F(PictureWorkerTest, EndsWhileOrdersWait) {
  Start({});
  const std::future<void> started = started_.get_future();
  for (std::uint64_t number = 1; number <= 3; ++number) Order(number, 10);
  started.wait();
  LetGo();
  worker_.reset();
  EXPECT_THAT(answers_, IsEmpty());
}

}  // namespace
}  // namespace livemap::vehicle
