#pragma once

#include <cstddef>
#include <deque>
#include <map>
#include <string>
#include <utility>

namespace livemap {

/// What waits for a service that clients share, in the order of a round: each client has one turn,
/// then the next client's comes, and each client's own items keep their order. So a client that
/// asks for much delays nobody but itself. Not thread-safe.
///
/// Typical usage:
///   Turns<Job> waiting;
///   waiting.Put(client, job);
///   while (!waiting.IsEmpty()) Do(waiting.TakeNext());
template <typename Item>
class Turns {
 public:
  /// Appends the item to what waits of this client.
  void Put(const std::string& client, Item item) {
    items_[client].push_back(std::move(item));
    ++size_;
  }
  /// Takes an item of the client that comes after the last one; something must wait.
  Item TakeNext() {
    auto client = items_.upper_bound(last_client_);
    if (client == items_.end()) client = items_.begin();
    last_client_ = client->first;
    Item item = std::move(client->second.front());
    client->second.pop_front();
    if (client->second.empty()) items_.erase(client);
    --size_;
    return item;
  }

  bool IsEmpty() const { return size_ == 0; }
  /// How many items wait, of all clients.
  std::size_t size() const { return size_; }
  /// How many items of this client wait.
  std::size_t SizeOf(const std::string& client) const {
    const auto found = items_.find(client);
    return found == items_.end() ? 0 : found->second.size();
  }

 private:
  std::map<std::string, std::deque<Item>> items_;  ///< By client; none is empty.
  std::string last_client_;                        ///< Whose turn it was.
  std::size_t size_ = 0;
};

}  // namespace livemap
