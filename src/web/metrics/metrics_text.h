#pragma once

#include <string>

#include "common/histogram.h"

namespace livemap::web {

/// Writes metrics in the text format of Prometheus, version 0.0.4
/// (https://prometheus.io/docs/instrumenting/exposition_formats/). Every family is begun once, then
/// has its samples.
class MetricsText {
 public:
  /// Begins a family. `type` is "counter", "gauge" or "histogram"; `help` is one line.
  void Begin(const std::string& name, const char* type, const std::string& help);
  /// A sample of the family, without labels.
  void Add(double value);
  /// One with a label; what the label's value holds is escaped.
  void Add(const std::string& label, const std::string& label_value, double value);
  /// The samples of a histogram, in seconds.
  void Add(const DurationHistogram::Counts& counts);

  const std::string& text() const { return text_; }

 private:
  void AddSample(const std::string& suffix, const std::string& labels, double value);

  std::string name_;
  std::string text_;
};

/// The media type of the format.
constexpr const char* kMetricsType = "text/plain; version=0.0.4; charset=utf-8";

}  // namespace livemap::web
