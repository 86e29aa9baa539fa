#pragma once

#include <vector>

namespace sinew::fem {

struct WeightedValue {
  double value = 0.0;
  double weight = 0.0;  ///< >= 0.
};

/// The value that `share` (0 ... 1) of the weight lies at or below; 0 where there are none. Values that are
/// equal are one.
double weighted_quantile(std::vector<WeightedValue> values, double share);

}  // namespace sinew::fem
