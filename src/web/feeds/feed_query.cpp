#include "web/feeds/feed_query.h"

#include <cstddef>
#include <string_view>

namespace livemap::web {
namespace {

constexpr std::size_t kMaxClassBytes = 64;

std::set<std::string> ParseClasses(const std::string& text) {
  std::set<std::string> classes;
  Split(text, ',', [&](std::string_view piece) {
    if (!piece.empty() && piece.size() <= kMaxClassBytes && classes.emplace(piece).second) return;
    throw BadRequest("class is " + Quoted(text) +
                     ", accepted are names of classes of at most 64 bytes, each once, with commas "
                     "between");
  });
  return classes;
}

zone::HazardStates ParseFeedStates(const std::string& text) {
  zone::HazardStates states;
  Split(text, ',', [&](std::string_view piece) {
    for (const zone::HazardState state : zone::StatesOnMap()) {
      if (piece == zone::HazardStateName(state) && states.insert(state).second) return;
    }
    throw BadRequest("state is " + Quoted(text) +
                     ", accepted are candidate, active and verifying, each once, with commas "
                     "between");
  });
  return states;
}

std::uint64_t ParseFeedSince(const std::string& text) {
  const auto number = WholeNumber(text);
  if (number && *number <= INT64_MAX) return *number;
  throw BadRequest("since is " + Quoted(text) +
                   ", accepted is a sequence number, a whole number from 0");
}

}  // namespace

FeedQuery ParseFeedQuery(const RequestTarget& target, const FeedParameters& accepted) {
  RefuseRepeated(target);
  FeedQuery query;
  for (const auto& [name, value] : target.parameters) {
    if (name == "bbox") {
      query.box = ParseBox(value);
    } else if (name == "class") {
      query.classes = ParseClasses(value);
    } else if (name == "state" && accepted.state) {
      query.states = ParseFeedStates(value);
    } else if (name == "since" && accepted.since) {
      query.since = ParseFeedSince(value);
    } else {
      RefuseUnknown(name, accepted.state   ? "accepted are bbox, class and state"
                          : accepted.since ? "accepted are bbox, class and since"
                                           : "accepted are bbox and class");
    }
  }
  return query;
}

}  // namespace livemap::web
