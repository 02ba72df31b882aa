#include "zone/store/answer_picture_table.h"

#include <algorithm>

#include "common/time.h"
#include "protocol/text_rules.h"
#include "zone/model/decision.h"
#include "zone/store/queries.h"
#include "zone/store/store_validation.h"

namespace livemap::zone {
namespace {

std::string IsSoundAnswerPicture(const Dialect& dialect) {
  return dialect.AreIntegers({"a.stamp_ns", "a.answer", "p.decision_id"}) + " AND " +
         dialect.AreNumbers({"a.confidence"}) + " AND " +
         dialect.AreTexts({{"p.image_sha256", 64}});
}
std::string IsSoundRequest(const Dialect& dialect) {
  return dialect.AreIntegers({"at_ns"}) + " AND " +
         dialect.AreTexts({{"subject", 36}, {"official", kMaxStoredTextBytes}});
}
constexpr std::size_t kAnswerKinds = 3;

bool IsImageHash(const std::string& text) {
  return text.size() == 64 && text.find_first_not_of("0123456789abcdef") == std::string::npos;
}

}  // namespace

void AnswerPictureTable::WriteAnswerPicture(const Uuid& poll, std::uint64_t hazard_id,
                                            const std::string& image_sha256,
                                            std::uint64_t decision) {
  ExplainStore("writing an answer's picture", [&] {
    const std::string uuid = poll.ToString();
    const auto hazard = static_cast<long long>(hazard_id);
    const auto request = static_cast<long long>(decision);
    connection_.session()
        << "INSERT INTO answer_pictures (poll_uuid, hazard_id, image_sha256, decision_id) "
           "VALUES (:u, :h, :i, :d)",
        soci::use(uuid), soci::use(hazard), soci::use(image_sha256), soci::use(request);
  });
}

std::vector<AnswerPicture> AnswerPictureTable::LoadAnswerPictures(std::uint64_t hazard_id,
                                                                  std::size_t limit) {
  return ExplainStore("reading answers' pictures", [&] {
    std::vector<AnswerPicture> pictures;
    const auto hazard = static_cast<long long>(hazard_id);
    const auto most = static_cast<long long>(limit);
    long long stamp_ns = 0, decision = 0;
    int answer = 0;
    AnswerPicture picture;
    soci::statement find =
        (connection_.session().prepare
             << "SELECT a.stamp_ns, a.answer, a.confidence, p.image_sha256, "
                "p.decision_id FROM answer_pictures p JOIN answers a ON a.poll_uuid = "
                "p.poll_uuid WHERE p.hazard_id = :h AND "
             << IsSoundAnswerPicture(connection_.dialect()) << " ORDER BY a.stamp_ns DESC LIMIT :l",
         soci::use(hazard), soci::use(most), soci::into(stamp_ns), soci::into(answer),
         soci::into(picture.confidence), soci::into(picture.image_sha256), soci::into(decision));
    connection_.Run(find);
    while (find.fetch()) {
      const bool is_sound = IsStamp(stamp_ns) && IsIndex(answer, kAnswerKinds) && decision >= 0 &&
                            decision < kMaxSequence && picture.confidence >= 0 &&
                            picture.confidence <= 1 && IsImageHash(picture.image_sha256);
      if (!is_sound) continue;
      picture.stamp_ns = stamp_ns;
      picture.answer = static_cast<protocol::PollAnswer::Answer>(answer);
      picture.decision = static_cast<std::uint64_t>(decision);
      pictures.push_back(picture);
    }
    return pictures;
  });
}

std::vector<FrameRequest> AnswerPictureTable::LoadFrameRequests(std::int64_t since_ns) {
  return ExplainStore("reading requests for frames", [&] {
    std::vector<FrameRequest> requests;
    const int kind = static_cast<int>(DecisionKind::kAskFrame);
    const long long since = since_ns;
    long long id = 0, at_ns = 0;
    std::string subject, official;
    soci::statement find =
        (connection_.session().prepare
             << "SELECT id, subject, official, at_ns FROM decisions WHERE kind = :k "
                "AND at_ns >= :s AND undone_by = 0 AND id NOT IN (SELECT decision_id "
                "FROM answer_pictures WHERE decision_id > 0) AND "
             << IsSoundRequest(connection_.dialect()) << " ORDER BY id",
         soci::use(kind), soci::use(since), soci::into(id), soci::into(subject),
         soci::into(official), soci::into(at_ns));
    connection_.Run(find);
    while (find.fetch()) {
      const auto hazard = Uuid::Parse(subject);
      const bool is_sound = hazard && id >= 1 && id < kMaxSequence && IsStamp(at_ns) &&
                            protocol::IsPrintableText(official, kMaxStoredTextBytes);
      if (!is_sound) continue;
      requests.push_back({static_cast<std::uint64_t>(id), *hazard, official, at_ns, 0});
    }
    return requests;
  });
}

}  // namespace livemap::zone
