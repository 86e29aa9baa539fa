#pragma once

#include <string>

#include <unistd.h>

#include <gtest/gtest.h>

namespace sinew::tests {

/// A path for `name` that no other process of these tests uses, nor one that was ended before it tidied up.
inline std::string temporary_path(const std::string& name) {
  return testing::TempDir() + "sinew_" + std::to_string(::getpid()) + "_" + name;
}

}  // namespace sinew::tests
