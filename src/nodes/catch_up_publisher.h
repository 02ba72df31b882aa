#pragma once

#include <ros/publisher.h>

#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "nodes/notice_pictures.h"
#include "zone/inbox/catch_up_planner.h"
#include "zone/service/zone_service.h"

namespace livemap::nodes {

/// Tells single vehicles what they missed or have around them, in portions, so that notices of new
/// hazards are not held up and nobody's queue overflows. The first hazards that are new to the
/// vehicle come with their small pictures, as far as the bytes of one telling go. Not thread-safe.
class CatchUpPublisher {
 public:
  struct Config {
    double radius_m = 5000;
    std::size_t max_hazards = 2000;
    std::size_t picture_bytes = 100000;  ///< Of all pictures of one telling; 0: none.
  };

  /// `zone` and `pictures` outlive it.
  CatchUpPublisher(const zone::ZoneService& zone, NoticePictures& pictures,
                   const ros::Publisher& publisher, const Config& config);

  void Add(zone::CatchUpOrder order) { orders_.push_back(std::move(order)); }
  bool busy() const { return current_.has_value() || !orders_.empty(); }
  /// Publishes the next portion. Returns the vehicle that has been told everything, if one has.
  std::optional<std::string> PublishBatch(std::int64_t now_ns);
  std::uint64_t notices() const { return notices_; }

 private:
  struct CatchUp {
    zone::CatchUpOrder order;
    std::uint64_t up_to = 0;
    double radius_m = 0;
    std::vector<zone::Hazard> hazards;
    std::size_t told = 0;
    std::size_t picture_bytes = 0;  ///< What is left of them.
  };

  void Begin();
  void CollectAll(CatchUp& telling) const;
  bool Tell(CatchUp& telling, int& made);

  const zone::ZoneService& zone_;
  NoticePictures& pictures_;
  const ros::Publisher publisher_;
  const Config config_;
  std::deque<zone::CatchUpOrder> orders_;
  std::optional<CatchUp> current_;
  std::uint64_t notices_ = 0;
};

}  // namespace livemap::nodes
