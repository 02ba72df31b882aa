#pragma once

#include <functional>
#include <string>

namespace livemap::vehicle {

/// A way to make the driver hear something. Used by one thread at a time.
class Voice {
 public:
  /// Whether what is being said must end at once. Quick, from the thread that says it.
  using MustStop = std::function<bool()>;

  Voice() = default;
  virtual ~Voice() = default;
  Voice(const Voice&) = delete;
  Voice& operator=(const Voice&) = delete;

  /// "speech" or "tone".
  virtual std::string name() const = 0;
  /// Gets ready, or gives up soon after `must_stop`. Throws Error with one sentence that says why
  /// nothing would be heard.
  virtual void Open(const MustStop& must_stop) = 0;
  /// Returns when the driver has heard it, or soon after `must_stop`. Throws Error with one
  /// sentence when nothing was heard.
  virtual void Say(const std::string& sentence, const MustStop& must_stop) = 0;
  /// Has a call that hangs in another thread end with Error, soon. The voice is of no use after it.
  virtual void Abort() {}
};

}  // namespace livemap::vehicle
