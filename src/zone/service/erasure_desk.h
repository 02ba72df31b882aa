#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "common/mutex.h"
#include "zone/store/erasure_requests.h"

namespace livemap::zone {

class ZoneService;

/// Carries out what `livemap zone forget` asks of a running zone, on a thread of its own.
class ErasureDesk {
 public:
  using Clock = std::function<std::int64_t()>;  ///< UTC, ns since 1970.
  /// Takes one line of text without any vehicle's name; the desk's thread calls it.
  using Log = std::function<void(const std::string&)>;

  /// Looks for requests in `directory` from now on. Keeps a reference to `zone`.
  ErasureDesk(std::string directory, ZoneService& zone, Clock now_ns, Log log);
  /// An erasure that is going on is finished first.
  ~ErasureDesk();
  ErasureDesk(const ErasureDesk&) = delete;
  ErasureDesk& operator=(const ErasureDesk&) = delete;

 private:
  void WorkUntilStopped();
  void WorkOff();

  const std::string directory_;
  ZoneService& zone_;
  const Clock now_ns_;
  const Log log_;
  std::unique_ptr<ErasureRequests> requests_;  ///< The thread's; null until there is a file.
  std::string told_;                           ///< The thread's: the failure that was told last.
  Mutex mutex_;
  ConditionVariable changed_;
  bool closing_ GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

/// Forgets the vehicle of the oldest request and says in the file what became of it. False when
/// there is none. Throws StoreError: then the request stays.
bool WorkOffErasure(ErasureRequests& requests, ZoneService& zone, std::int64_t now_ns);

}  // namespace livemap::zone
