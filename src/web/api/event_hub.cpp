#include "web/api/event_hub.h"

#include <utility>

#include "web/json/json.h"
#include "web/json/map_change_json.h"

namespace livemap::web {

EventHub::EventHub(zone::MapReader& zone, const protocol::HazardCatalogue& catalogue,
                   VehicleTrails& trails)
    : zone_(zone), catalogue_(catalogue), trails_(trails) {
  subscription_ = zone_.Subscribe([this](const zone::ZoneEvent& event) { Publish(event); });
}

EventHub::~EventHub() {
  zone_.Unsubscribe(subscription_);
  Stop();
}

void EventHub::Join(const std::shared_ptr<LiveListener>& listener) {
  const MutexLock lock(mutex_);
  if (!stopped_) listeners_[listener.get()] = listener;
}

void EventHub::Leave(const LiveListener* listener) {
  std::shared_ptr<LiveListener> released;  // Destroyed after the lock is given back.
  const MutexLock lock(mutex_);
  const auto found = listeners_.find(listener);
  if (found == listeners_.end()) return;
  released = std::move(found->second);
  listeners_.erase(found);
}

void EventHub::Stop() {
  decltype(listeners_) released;
  const MutexLock lock(mutex_);
  stopped_ = true;
  released.swap(listeners_);
}

void EventHub::Publish(const zone::ZoneEvent& event) {
  if (event.vehicle) trails_.Add(*event.vehicle);
  if (event.forgotten) trails_.Forget(*event.forgotten);
  const MutexLock lock(mutex_);
  if (listeners_.empty()) return;
  LiveMessage message;
  if (event.hazard) {
    message.sequence = event.hazard->hazard.sequence;
    message.is_told = event.hazard->announced;
    message.text = std::make_shared<const std::string>(
        ToText(HazardMessage(event.hazard->action, event.hazard->hazard, catalogue_,
                             zone_.WordsOf(event.hazard->hazard))));
  } else if (event.map_change) {
    message.sequence = event.map_change->feature.sequence;
    message.text = std::make_shared<const std::string>(
        ToText(MapChangeMessage(event.map_change->Action(), event.map_change->feature)));
  } else if (event.vehicle) {
    message.text = std::make_shared<const std::string>(ToText(VehicleMessage(*event.vehicle)));
  } else {
    return;
  }
  for (const auto& entry : listeners_) entry.second->Deliver(message);
}

}  // namespace livemap::web
