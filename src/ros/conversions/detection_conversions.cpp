#include "ros/conversions/detection_conversions.h"

#include <sensor_msgs/image_encodings.h>

#include <boost/make_shared.hpp>

#include "perception/detection/annotation.h"

namespace livemap::ros_io {

DetectionArray ToMessage(const std::vector<perception::HazardDetection>& detections,
                         const std_msgs::Header& header, const std::string& model,
                         cv::Size image_size, double inference_ms) {
  DetectionArray message;
  message.header = header;
  message.model = model;
  message.image_width = static_cast<std::uint32_t>(image_size.width);
  message.image_height = static_cast<std::uint32_t>(image_size.height);
  message.inference_ms = static_cast<float>(inference_ms);
  message.detections.resize(detections.size());
  for (std::size_t i = 0; i < detections.size(); ++i) {
    message.detections[i].class_name = detections[i].class_name;
    message.detections[i].confidence = detections[i].confidence;
    message.detections[i].x_min = detections[i].box.x;
    message.detections[i].y_min = detections[i].box.y;
    message.detections[i].x_max = detections[i].box.x + detections[i].box.width;
    message.detections[i].y_max = detections[i].box.y + detections[i].box.height;
  }
  return message;
}

sensor_msgs::ImagePtr ToAnnotatedMessage(const cv::Mat& bgr,
                                         const std::vector<perception::HazardDetection>& detections,
                                         const std_msgs::Header& header) {
  auto message = boost::make_shared<sensor_msgs::Image>();
  message->header = header;
  message->encoding = sensor_msgs::image_encodings::BGR8;
  message->width = static_cast<std::uint32_t>(bgr.cols);
  message->height = static_cast<std::uint32_t>(bgr.rows);
  message->step = 3 * message->width;
  message->data.resize(std::size_t{message->step} * message->height);
  cv::Mat pixels(bgr.rows, bgr.cols, CV_8UC3, message->data.data(), message->step);
  bgr.copyTo(pixels);
  perception::AnnotateImage(pixels, detections);
  return message;
}

}  // namespace livemap::ros_io
