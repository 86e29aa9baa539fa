#pragma once

#include <fstream>
#include <string>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace sinew::tests {

/// The closed forms of the shared reference.
inline nlohmann::json analytic() {
  std::ifstream stream(std::string(SINEW_SHARED_DIR) + "/reference/analytic.json");
  EXPECT_TRUE(stream.good());
  return nlohmann::json::parse(stream);
}

}  // namespace sinew::tests
