#include "fem/material/weighted_quantile.h"

#include <algorithm>
#include <tuple>

namespace sinew::fem {

double weighted_quantile(std::vector<WeightedValue> values, double share) {
  std::sort(values.begin(), values.end(), [](const WeightedValue& a, const WeightedValue& b) {
    return std::tie(a.value, a.weight) < std::tie(b.value, b.weight);
  });
  double total = 0.0;
  for (const WeightedValue& v : values) total += v.weight;
  double sum = 0.0;
  for (const WeightedValue& v : values) {
    sum += v.weight;
    if (sum >= share * total) return v.value;
  }
  return 0.0;
}

}  // namespace sinew::fem
