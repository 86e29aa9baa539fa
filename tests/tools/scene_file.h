#pragma once

#include <filesystem>
#include <fstream>
#include <string>

#include <gtest/gtest.h>

#include "assets/error.h"
#include "tools/scene/scene.h"

namespace sinew::tools {

namespace fs = std::filesystem;

/// A directory of its own per test, made the current one, so that paths in messages are short and the same
/// anywhere.
class SceneFile : public testing::Test {
 protected:
  void SetUp() override {
    before_ = fs::current_path();
    const auto* info = testing::UnitTest::GetInstance()->current_test_info();
    directory_ = fs::path(SINEW_BINARY_DIR) / "scene_test" / info->name();
    fs::remove_all(directory_);
    fs::create_directories(directory_);
    fs::current_path(directory_);
  }
  void TearDown() override { fs::current_path(before_); }

  static Scene read(const std::string& text, const std::string& file = "scene.toml") {
    std::ofstream(file, std::ios::binary) << text;
    return read_scene(file);
  }

  static std::string refusal(const std::string& text) {
    try {
      read(text);
    } catch (const assets::ConfigError& e) {
      return e.what();
    }
    return "accepted";
  }

 private:
  fs::path before_, directory_;
};
}  // namespace sinew::tools
