#pragma once

#include <cstdio>
#include <string>

#include <gtest/gtest.h>

namespace sinew::tests {

/// Keeps a measured number, printed by `format`, with the test's result: tools/tables puts it into the
/// tables of tests/measured. `key` is letters, digits and _.
inline void publish(const std::string& key, const char* format, double value) {
  char text[64];
  std::snprintf(text, sizeof text, format, value);
  testing::Test::RecordProperty(key, text);
}

/// The smallest and largest of measured numbers, under `key`_min and `key`_max.
class Range {
 public:
  void add(double value) {
    low_ = none_ || value < low_ ? value : low_;
    high_ = none_ || value > high_ ? value : high_;
    none_ = false;
  }
  double high() const { return high_; }
  void publish(const std::string& key, const char* format) const {
    tests::publish(key + "_min", format, low_);
    tests::publish(key + "_max", format, high_);
  }

 private:
  bool none_ = true;
  double low_ = 0.0, high_ = 0.0;
};

}  // namespace sinew::tests
