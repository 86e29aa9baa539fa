// What happens before and around the importers: files that are not files, and importers that die.
#include <array>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "assets/detail/importer_process.h"
#include "assets/detail/scene_archive.h"
#include "assets/detail/text.h"
#include "assets/error.h"
#include "assets/rig.h"
#include "tests/assets/tiny_gltf.h"

namespace sinew::assets {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

Rig load(const std::string& file) { return load_rig(file, {0.0, SINEW_IMPORTER}); }

template <typename Error>
std::string error_of(const std::string& file) {
  try {
    load(file);
  } catch (const Error& e) {
    return e.what();
  }
  return "accepted";
}

/// A program that stands in for the importer.
std::string script(const std::string& name, const std::string& body) {
  const std::string path = write_file(name, "#!/bin/sh\n" + body + "\n");
  std::filesystem::permissions(path, std::filesystem::perms::owner_all);
  return path;
}

TEST(LoadRig, MissingFileIsAnIoErrorWithBothPaths) {
  const std::string relative = std::filesystem::relative(test_folder() + "none.glb").string();
  EXPECT_EQ(error_of<IoError>(relative), relative + ": not found, looked for " +
                                             (std::filesystem::current_path() / relative).string() +
                                             "; hint: check the spelling of the path");
}

TEST(LoadRig, DirectoriesPipesAndDevicesAreRefusedWithoutWaiting) {
  const std::string folder = test_folder() + "folder.glb";
  std::filesystem::create_directories(folder);
  EXPECT_EQ(error_of<IoError>(folder),
            folder +
                ": not a regular file, got a directory; hint: name the file of the "
                "character itself");
  const std::string pipe = test_folder() + "pipe.glb";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_THAT(error_of<IoError>(pipe), HasSubstr("not a regular file, got a pipe"));
  EXPECT_THAT(error_of<IoError>("/dev/zero"), HasSubstr("not a regular file, got a device"));
}

TEST(LoadRig, EmptyFileNamesTheFormats) {
  const std::string file = write_file("empty.fbx", "");
  EXPECT_EQ(
      error_of<InputError>(file),
      file +
          ": file is empty, got 0 bytes, expected glTF (.glb, .gltf), FBX, Collada (.dae), BVH or another "
          "format that assimp reads; hint: export or copy the file again");
}

TEST(LoadRig, APictureUnderTheNameOfAGlbIsToldByItsMagic) {
  const std::string file = write_file("picture.glb", "\x89PNG\r\n\x1a\n");
  EXPECT_EQ(error_of<InputError>(file),
            file +
                ": GLB header: magic, got 89 50 4e 47 ('\\x89PNG'), expected 67 6c 54 46 "
                "('glTF'); hint: the file is something else under this name");
}

TEST(LoadRig, NamesWithBlanksLettersBeyondAsciiAndALeadingDashWork) {
  const std::string bytes = TinyGltf().glb();
  for (const char* name :
       {"a b.glb", "für.glb", "\xF0\x9F\xA6\x98.glb", "two\nlines.glb", "\xff\xfe.glb", "$(x).glb"}) {
    EXPECT_EQ(load(write_file(name, bytes)).parts.size(), 1u) << name;
  }
  const std::filesystem::path before = std::filesystem::current_path();
  write_file("-dash.glb", bytes);
  std::filesystem::current_path(test_folder());
  EXPECT_EQ(load("-dash.glb").parts.size(), 1u);
  std::filesystem::current_path(before);
  EXPECT_THAT(error_of<IoError>(std::string(5000, 'a') + ".glb"), HasSubstr("File name too long"));
}

TEST(LoadRig, ALinkThatPointsToItselfIsNamedSo) {
  const std::string link = test_folder() + "loop.glb";
  std::filesystem::create_symlink(link, link);
  EXPECT_THAT(error_of<IoError>(link), HasSubstr("Too many levels of symbolic links"));
}

TEST(LoadRig, SayingTheHeightScalesToIt) {
  const std::string file = write_file("tiny.glb", TinyGltf().glb());
  const Rig rig = load_rig(file, {1.75, SINEW_IMPORTER});
  EXPECT_DOUBLE_EQ(rig.height, 1.75);
  EXPECT_DOUBLE_EQ(rig.metres_per_unit, 1.75);
  EXPECT_DOUBLE_EQ(rig.parts[0].points(2, 1), 1.75);
  EXPECT_DOUBLE_EQ(rig.skeleton.joint(1).rest_from_joint.translation().y(), 0.875);
  EXPECT_THROW(load_rig(file, {-1.0, SINEW_IMPORTER}), ConfigError);
}

TEST(Importer, ThatCannotBeStartedIsAnIoError) {
  const std::string file = write_file("tiny.glb", TinyGltf().glb());
  try {
    load_rig(file, {0.0, "/nowhere/sinew-import"});
    FAIL() << "started";
  } catch (const IoError& e) {
    EXPECT_STREQ(
        e.what(),
        "/nowhere/sinew-import: importer cannot be started: No such file or directory; hint: install "
        "sinew-import beside sinew");
  }
}

TEST(Importer, ThatDiesIsReportedByItsSignal) {
  const std::string file = write_file("tiny.fbx", "x");
  const std::string dies = script("dies", "kill -SEGV $$");
  try {
    load_rig(file, {0.0, dies});
    FAIL() << "survived";
  } catch (const InputError& e) {
    EXPECT_EQ(std::string(e.what()),
              file +
                  ": importer: crashed on this file, got signal 11 (Segmentation fault); the "
                  "file is probably malformed; hint: open the file in Blender and export it "
                  "as .glb");
  }
}

TEST(Importer, ThatHangsIsEndedInTime) {
  const std::string file = write_file("tiny.fbx", "x");
  const std::string hangs = script("hangs", "exec sleep 60");
  try {
    detail::import_in_process(hangs, file, {.memory_bytes = 0, .seconds = 0.2});
    FAIL() << "answered";
  } catch (const LimitError& e) {
    EXPECT_EQ(
        std::string(e.what()),
        file + ": importer: time used up, got no answer in 0.2 s; hint: export a smaller scene, or as .glb");
  }
}

#if !defined(__SANITIZE_ADDRESS__)  // which needs terabytes of address space itself
TEST(Importer, WithoutMemoryIsALimitNotACrash) {
  // 96 MB of positions, read as bytes, as JSON's buffer and as doubles, do not fit into 256 MB of address
  // space.
  TinyGltf gltf;
  gltf.primitive()["attributes"].erase("JOINTS_0");
  gltf.primitive()["attributes"].erase("WEIGHTS_0");
  gltf.primitive()["attributes"]["POSITION"] =
      gltf.add<float>("VEC3", 5126, std::vector<float>(std::size_t{24} << 20, 0.0F), 3);
  const std::string file = write_file("large.glb", gltf.glb());
  try {
    detail::import_in_process(SINEW_IMPORTER, file,
                              {.memory_bytes = std::uint64_t{256} << 20, .seconds = 60});
    FAIL() << "fitted";
  } catch (const LimitError& e) {
    EXPECT_EQ(std::string(e.what()), file + ": importer: memory used up; hint: export a smaller scene");
  }
}
#endif

TEST(Importer, ThatAnswersNonsenseIsNotBelieved) {
  const std::string file = write_file("tiny.fbx", "x");
  const std::string mute = script("mute", "exit 0");
  const std::string liar = script("liar", "printf 'Snonsense' >&3");
  for (const std::string& program : {mute, liar}) {
    EXPECT_THROW(detail::import_in_process(program, file), InputError) << program;
  }
}

TEST(SceneArchive, GivesBackEveryBit) {
  const std::string file = write_file("tiny.glb", TinyGltf().glb());
  const detail::ImportedScene scene = detail::import_in_process(SINEW_IMPORTER, file);
  const std::string bytes = detail::write_scene(scene);
  EXPECT_EQ(detail::write_scene(detail::read_scene(bytes)), bytes);
}

TEST(SceneArchive, CutOrChangedAtAnyByteIsRefusedOrHarmless) {
  const std::string file = write_file("tiny.glb", TinyGltf().glb());
  const std::string bytes = detail::write_scene(detail::import_in_process(SINEW_IMPORTER, file));
  for (std::size_t length = 0; length < bytes.size(); ++length) {
    EXPECT_THROW(detail::read_scene(std::string_view(bytes).substr(0, length)), std::runtime_error) << length;
  }
  // A flipped bit may give another valid scene; what it may not give is anything but a scene or a named
  // error.
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    std::string changed = bytes;
    changed[i] = static_cast<char>(changed[i] ^ 0x80);
    try {
      detail::ImportedScene scene = detail::read_scene(changed);
      detail::check_scene(file, scene);
    } catch (const std::runtime_error& e) {
      EXPECT_STRNE(e.what(), "") << i;
    }
  }
}

TEST(LoadRig, StandsValvesModelsUp) {
  // A tetrahedron 1 high on two joints one above the other, along z as that format has it.
  std::string smd = "version 1\nnodes\n0 \"root\" -1\n1 \"tip\" 0\nend\nskeleton\n";
  for (const char* turn : {"0", "0.5"})
    smd += std::string("time ") + (*turn == '0' && turn[1] == 0 ? "0" : "30") +
           "\n0 0 0 0 0 0 0\n1 0 0 0.5 " + turn + " 0 0\n";
  smd += "end\ntriangles\n";
  const std::array<std::string, 4> corner{"0 0 0 0", "0 0.5 0 0", "0 0 0.25 0", "1 0 0 1"};
  for (const auto& t : std::vector<std::array<std::size_t, 3>>{{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}) {
    smd += "skin\n";
    for (const std::size_t c : t) smd += corner[c] + " 0 0 1 0 0\n";
  }
  const Rig rig = load_rig(write_file("worm.smd", smd + "end\n"), {0.0, SINEW_IMPORTER});
  EXPECT_EQ(rig.up_axis, UpAxis::Z);
  EXPECT_NEAR(rig.height, 1.0, 1e-6);  // single precision
  const int tip = rig.skeleton.find("tip");
  ASSERT_GE(tip, 0);
  EXPECT_NEAR(rig.skeleton.joint(tip).rest_from_joint.translation().y(), 0.5, 1e-6);
}

TEST(Printable, KeepsWordsOfEveryLanguageAndEscapesTheRest) {
  EXPECT_EQ(detail::printable("Hüfte \xF0\x9F\xA6\x98"), "Hüfte \xF0\x9F\xA6\x98");
  EXPECT_EQ(detail::printable("a\nb\x1b[31m\x7f"), "a\\x0ab\\x1b[31m\\x7f");
  // Overlong slash, lone continuation, surrogate, cut sequence.
  EXPECT_EQ(detail::printable("\xC0\xAF"), "\\xc0\\xaf");
  EXPECT_EQ(detail::printable("\x80"), "\\x80");
  EXPECT_EQ(detail::printable("\xED\xA0\x80"), "\\xed\\xa0\\x80");
  EXPECT_EQ(detail::printable("\xE2\x82"), "\\xe2\\x82");
}

}  // namespace
}  // namespace sinew::assets
