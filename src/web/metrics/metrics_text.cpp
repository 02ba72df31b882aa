#include "web/metrics/metrics_text.h"

#include <array>
#include <charconv>
#include <cstdint>

namespace livemap::web {
namespace {

std::string MetricNumber(double value) {
  std::array<char, 40> buffer;
  const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
  return {buffer.data(), end.ptr};
}

std::string EscapedLabel(const std::string& value) {
  std::string escaped;
  for (const char c : value) {
    if (c == '\\' || c == '"') escaped += '\\';
    if (c == '\n') {
      escaped += "\\n";
    } else {
      escaped += c;
    }
  }
  return escaped;
}

}  // namespace

void MetricsText::Begin(const std::string& name, const char* type, const std::string& help) {
  name_ = name;
  text_ += "# HELP " + name + ' ' + help + "\n# TYPE " + name + ' ' + type + '\n';
}

void MetricsText::Add(double value) { AddSample("", "", value); }

void MetricsText::Add(const std::string& label, const std::string& label_value, double value) {
  AddSample("", label + "=\"" + EscapedLabel(label_value) + '"', value);
}

void MetricsText::Add(const DurationHistogram::Counts& counts) {
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < counts.by_bound.size(); ++i) {
    sum += counts.by_bound.at(i);
    const bool is_last = i == DurationHistogram::kBoundsS.size();
    const std::string bound = is_last ? "+Inf" : MetricNumber(DurationHistogram::kBoundsS.at(i));
    AddSample("_bucket", "le=\"" + bound + '"', static_cast<double>(sum));
  }
  AddSample("_sum", "", counts.sum_s);
  AddSample("_count", "", static_cast<double>(sum));
}

void MetricsText::AddSample(const std::string& suffix, const std::string& labels, double value) {
  text_ += name_ + suffix;
  if (!labels.empty()) text_ += '{' + labels + '}';
  text_ += ' ' + MetricNumber(value) + '\n';
}

}  // namespace livemap::web
