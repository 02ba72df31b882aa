#include "simulation/change.h"

#include <gtest/gtest.h>
