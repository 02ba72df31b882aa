#include "streets/turn_habit.h"

namespace livemap::streets {

void TurnHabit::Passed(bool turned) {
  turned_ *= config_.later_junctions;
  straight_ *= config_.later_junctions;
  (turned ? turned_ : straight_) += 1;
}

void TurnHabit::Reset() {
  turned_ = 0;
  straight_ = 0;
}

double TurnHabit::factor() const {
  const double usual = config_.usual_share * config_.usual_junctions;
  const double usual_straight = (1 - config_.usual_share) * config_.usual_junctions;
  return (1 + turned_ / usual) / (1 + straight_ / usual_straight);
}

}  // namespace livemap::streets
