#pragma once

#include <ros/message_traits.h>
#include <rosbag/bag.h>

#include <boost/make_shared.hpp>
#include <string>

namespace livemap::tools {

/// Frame of the camera's images in our bags (REP 103: z forward, x right, y down).
constexpr char kOpticalFrame[] = "camera_optical_frame";

/// Writes a bag beside its final name and renames it when it is whole, so that an interrupted run
/// leaves no half bag under the name that was asked for.
class BagWriter {
 public:
  enum class Compression { kNone, kLz4 };

  /// Throws Error when the file cannot be created.
  BagWriter(const std::string& path, Compression compression);
  /// Removes what was not finished.
  ~BagWriter();
  BagWriter(const BagWriter&) = delete;
  BagWriter& operator=(const BagWriter&) = delete;

  template <typename Message>
  void Write(const std::string& topic, const ros::Time& stamp, const Message& message) {
    bag_.write(topic, stamp, message);
  }

  /// For what a late subscriber must still get (tf_static): rosbag play publishes it latched.
  template <typename Message>
  void WriteLatched(const std::string& topic, const ros::Time& stamp, const Message& message) {
    auto header = boost::make_shared<ros::M_string>();
    (*header)["latching"] = "1";
    (*header)["callerid"] = "/livemap_bag";
    (*header)["topic"] = topic;
    (*header)["type"] = ros::message_traits::datatype(message);
    (*header)["md5sum"] = ros::message_traits::md5sum(message);
    (*header)["message_definition"] = ros::message_traits::definition(message);
    bag_.write(topic, stamp, message, header);
  }

  /// Closes the bag and gives it its name. Throws Error when that fails.
  void Finish();

 private:
  const std::string path_;
  const std::string unfinished_path_;
  rosbag::Bag bag_;
  bool finished_ = false;
};

}  // namespace livemap::tools
