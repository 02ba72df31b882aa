#include "zone/labels/label_export.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "common/error.h"
#include "test/zone/zone_fixture.h"

namespace livemap::zone {
namespace {

using testing::HasSubstr;

std::string TextOf(const std::string& path) {
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

class LabelExportTest : public ZoneTest {
 protected:
  LabelExportTest() : zone_(std::make_unique<ZoneService>(Config(), Clock(), 1)) {}

  /// A picture of 60x40 pixels that shows a part of the image, all of one grey.
  static protocol::Report ReportWithPicture(const std::string& class_name, int grey,
                                            double longitude_deg) {
    protocol::Report report = MakeReport({40.44, longitude_deg});
    report.class_name = class_name;
    cv::imencode(".jpg", cv::Mat(40, 60, CV_8UC3, cv::Scalar::all(grey)), report.image);
    report.image_format = "jpeg";
    report.shown = {100, 200, 120, 80};
    report.box = {130, 220, 160, 260};
    return report;
  }
  /// The folder that is written to.
  std::string Out() const { return directory_ + "/own"; }
  /// The one file of that folder.
  std::string OnlyFile(const std::string& folder) const {
    std::string name;
    for (const auto& entry : std::filesystem::directory_iterator(Out() + "/" + folder)) {
      EXPECT_EQ(name, "") << "one file was expected";
      name = entry.path().filename().string();
    }
    return name;
  }
  std::string WhyRefused() const {
    try {
      ExportLabels(directory_ + "/zone", Out(), store_url_);
    } catch (const Error& error) {
      return error.what();
    }
    return "it is accepted";
  }

  std::unique_ptr<ZoneService> zone_;
};

TEST_F(LabelExportTest, AConfirmedHazardIsLabelledByItsBoxInThePicture) {
  const Uuid hazard = zone_->Handle(ReportWithPicture("pothole", 90, -79.94)).hazard_uuid;
  zone_->Confirm(hazard, "Miller, \"J\"");
  const LabelExport done = ExportLabels(directory_ + "/zone", Out(), store_url_);
  EXPECT_EQ(done.pictures, 1U);
  EXPECT_EQ(done.boxes, 1U);
  EXPECT_EQ(done.backgrounds, 0U);
  EXPECT_EQ(TextOf(Out() + "/classes.txt"), "pothole\n");
  // From 30 of 120 to 60 across, from 20 of 80 to 60 down.
  EXPECT_EQ(TextOf(Out() + "/labels/" + OnlyFile("labels")),
            "0 0.375000 0.500000 0.250000 0.500000\n");
  EXPECT_EQ(cv::imread(Out() + "/images/" + OnlyFile("images")).cols, 60);
  EXPECT_EQ(TextOf(Out() + "/decisions.csv"),
            "picture,hazard,class,decision,official,time\n" + OnlyFile("images") + "," +
                hazard.ToString() +
                ",pothole,confirm,\"Miller, \"\"J\"\"\",2023-11-14T22:13:20Z\n");
}

TEST_F(LabelExportTest, ARejectedHazardIsBackgroundAndAnUndecidedOneNeither) {
  zone_->Reject(zone_->Handle(ReportWithPicture("pothole", 90, -79.94)).hazard_uuid, "miller",
                "a shadow");
  zone_->Handle(ReportWithPicture("pothole", 91, -79.90));  // Nobody has decided about it.
  // The same picture shows one about which nobody has decided.
  protocol::Report other = ReportWithPicture("debris", 90, -79.80);
  other.box = {100, 200, 160, 280};
  zone_->Handle(other);
  const LabelExport done = ExportLabels(directory_ + "/zone", Out(), store_url_);
  EXPECT_EQ(done.pictures, 1U);
  EXPECT_EQ(done.backgrounds, 1U);
  EXPECT_EQ(TextOf(Out() + "/labels/" + OnlyFile("labels")), "");
  EXPECT_EQ(TextOf(Out() + "/difficult/" + OnlyFile("difficult")),
            "0 0.250000 0.500000 0.500000 1.000000\n");
  EXPECT_THAT(TextOf(Out() + "/decisions.csv"), HasSubstr(",pothole,reject,\"miller\","));
}

TEST_F(LabelExportTest, WhatWasUndoneIsNoDecision) {
  const Uuid hazard = zone_->Handle(ReportWithPicture("pothole", 90, -79.94)).hazard_uuid;
  zone_->Confirm(hazard, "miller");
  zone_->Undo(hazard, "miller");
  EXPECT_THAT(WhyRefused(), HasSubstr("no official has decided"));
  zone_->Confirm(hazard, "miller");
  zone_->Reject(hazard, "jones", "a shadow");
  zone_->Undo(hazard, "jones");
  EXPECT_EQ(ExportLabels(directory_ + "/zone", Out(), store_url_).boxes, 1U)
      << "the confirmation stands";
}

TEST_F(LabelExportTest, CountsWhatIsLeftOut) {
  zone_->Confirm(zone_->Handle(MakeReport({40.44, -79.94})).hazard_uuid, "miller");
  zone_->Confirm(zone_->Handle(ReportWithPicture("Pot hole!", 90, -79.90)).hazard_uuid, "miller");
  zone_->Confirm(zone_->Handle(ReportWithPicture("pothole", 91, -79.80)).hazard_uuid, "miller");
  zone_->Confirm(zone_->Handle(ReportWithPicture("pothole", 92, -79.70)).hazard_uuid, "miller");
  const auto picture = zone_->Query(std::nullopt, 0, 10).back().image_sha256;
  std::filesystem::remove(*zone_->ImagePath(picture));
  const LabelExport done = ExportLabels(directory_ + "/zone", Out(), store_url_);
  EXPECT_EQ(done.pictures, 1U);
  EXPECT_EQ(done.no_box, 1U);
  EXPECT_EQ(done.odd_classes, 1U);
  EXPECT_EQ(done.no_picture, 1U);
}

TEST_F(LabelExportTest, RefusesAFullFolderAndAFolderWithoutAStore) {
  std::filesystem::create_directories(Out() + "/images");
  EXPECT_THAT(WhyRefused(), HasSubstr("is there already"));
  EXPECT_THROW(ExportLabels(directory_, Out()), Error);
}

TEST_F(LabelExportTest, TheTrainingReadsIt) {
  zone_->Confirm(zone_->Handle(ReportWithPicture("pothole", 90, -79.94)).hazard_uuid, "miller");
  zone_->Reject(zone_->Handle(ReportWithPicture("pothole", 91, -79.90)).hazard_uuid, "miller",
                "no");
  ExportLabels(directory_ + "/zone", Out(), store_url_);
  const std::string script = directory_ + "/read.py";
  std::ofstream(script) << "import sys, pathlib\n"
                           "sys.path.insert(0, sys.argv[1])\n"
                           "from detector import data\n"
                           "own = pathlib.Path(sys.argv[2])\n"
                           "classes = data.with_own_classes([own])\n"
                           "pictures = data.read_own([own], classes)['own:0']\n"
                           "boxes = sorted(picture.boxes.tolist() for picture in pictures)\n"
                           "assert boxes == [[], [[15.0, 10.0, 30.0, 30.0]]], boxes\n"
                           "assert all(classes[i] == 'pothole' for picture in pictures\n"
                           "           for i in picture.classes)\n"
                           "assert pictures[0].labelled_classes == [classes.index('pothole')]\n";
  const std::string command =
      "/usr/bin/python3 " + script + " " LIVEMAP_SOURCE_DIR "/training " + Out();
  EXPECT_EQ(std::system(command.c_str()), 0);
}

}  // namespace
}  // namespace livemap::zone
