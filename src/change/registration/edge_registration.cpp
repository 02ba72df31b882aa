#include "change/registration/edge_registration.h"

#include <array>
#include <functional>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgproc.hpp>
#include <string>

namespace livemap::change {
namespace {

/// Runs all of them, in OpenCV's threads; returns when the last is done.
template <typename... Tasks>
void RunInParallel(const Tasks&... tasks) {
  const std::array<std::function<void()>, sizeof...(Tasks)> all{tasks...};
  cv::parallel_for_(cv::Range(0, static_cast<int>(all.size())), [&](const cv::Range& range) {
    for (int i = range.start; i < range.end; ++i) all[static_cast<std::size_t>(i)]();
  });
}

}  // namespace

Registration RegisterByEdges(const cv::Mat& before, const cv::Mat& after,
                             const RegistrationConfig& options) {
  Registration registration;
  CheckRegistrationSizes(before.size(), after.size(), registration);
  if (!registration.accepted()) return registration;
  if (!HasEdgeCells(after.size())) {
    RefuseRegistration(
        RegistrationRefusal::kEdges,
        "the pictures are " + std::to_string(after.cols) + "x" + std::to_string(after.rows) +
            ", for their edges 32x32 and more are accepted, a side up to four times the other",
        registration);
    return registration;
  }
  // Filters of small pictures leave most cores idle: the pictures are looked at side by side.
  EdgeCells before_coarse;
  EdgeCells after_coarse;
  EdgeCells after_fine;
  RunInParallel([&] { before_coarse = ExtractEdgeCells(before, EdgeDetail::kCoarse); },
                [&] { after_coarse = ExtractEdgeCells(after, EdgeDetail::kCoarse); },
                [&] { after_fine = ExtractEdgeCells(after, EdgeDetail::kFine); });
  const EdgeAlignment alignment = AlignByEdges(before_coarse, after_coarse, options.edges);
  cv::Mat aligned;
  cv::warpPerspective(before, aligned, alignment.after_from_before, before.size(), cv::INTER_LINEAR,
                      cv::BORDER_REPLICATE);
  const double agreement = EdgeAgreement(ExtractEdgeCells(aligned, EdgeDetail::kFine), after_fine);
  registration.edge_evidence = alignment.correlation + alignment.lead + agreement;
  if (registration.edge_evidence < options.min_edge_evidence) {
    RefuseRegistration(RegistrationRefusal::kEdges,
                       "the edges correlate by " + RegistrationFigure(alignment.correlation) +
                           ", " + RegistrationFigure(alignment.lead) +
                           " above any other place, and agree by " + RegistrationFigure(agreement) +
                           " in detail, accepted is a sum of " +
                           RegistrationFigure(options.min_edge_evidence) + " and more",
                       registration);
    return registration;
  }
  registration.after_from_before = alignment.after_from_before;
  const cv::Mat full(before.size(), CV_8UC1, cv::Scalar(255));
  CheckOverlap(WarpByHomography(full, alignment.after_from_before), options, registration);
  return registration;
}

}  // namespace livemap::change
