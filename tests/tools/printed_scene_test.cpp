#include <random>
#include <string>

#include <gtest/gtest.h>

#include "assets/error.h"
#include "fem/models/model.h"
#include "tests/comma_locale.h"
#include "tests/tools/scene_file.h"
#include "tools/scene/scene.h"
#include "tools/scene/scene_fields.h"

/// Scenes printed as files and read again.
namespace sinew::tools {
namespace {

/// Any scene within the ranges; digits come from the generator's own bits, as the standard distributions
/// differ between libraries.
Scene random_scene(std::mt19937_64& rng) {
  const auto unit = [&] { return static_cast<double>(rng() >> 11) * 0x1.0p-53; };
  const auto index = [&](int n) { return static_cast<int>(rng() % static_cast<std::uint64_t>(n)); };
  const auto text = [&] {
    const char* const letters[] = {"a", "Z", "\"", "\\", " ",    "\n", "\t",
                                   "#", "'", "é",  "骨", "\x7F", "*",  "="};
    std::string result = "n";
    for (int i = index(8); i > 0; --i) result += letters[index(14)];
    return result;
  };
  Scene scene;
  scene.rig = text();
  scene.output = text();
  scene.overwrite = index(2) == 1;
  scene.strict = index(2) == 1;
  scene.json = index(2) == 1;
  if (index(2) == 1) scene.clip = text();
  if (index(2) == 1) scene.lattice = text();
  scene.cells = 20 + index(1000);
  const bool built = scene.lattice.empty();
  if (built && index(2) == 1) scene.cell_size = 0.01 + unit();
  if (built && index(2) == 1) scene.bones_include = {"arm*", "a \"leg\""};
  if (built && index(2) == 1) scene.bones_exclude = {"toe_?"};
  scene.tip_bones = index(2) == 1 ? Switch::On : Switch::Off;
  scene.symmetry = index(2) == 1 ? Switch::On : Switch::Off;
  if (built && index(2) == 1) scene.coarsen_rigid = Switch::On;
  if (built && index(2) == 1) scene.grade = Switch::Off;
  if (built && index(2) == 1) scene.sizes = {{{text(), "a*"}, 0.25 + 3.75 * unit()}, {{"b"}, 1.0}};
  if (index(2) == 1) scene.guard = Switch::Off;
  if (index(2) == 1)
    scene.part_roles = {{text(), static_cast<assets::PartRole>(index(4))}, {"b*", assets::PartRole::Rigid}};
  if (index(2) == 1) scene.bone_roles = {{text(), static_cast<assets::PartRole>(index(4))}};
  scene.preview = index(2) == 1 ? Switch::On : Switch::Off;
  scene.levels = index(4);
  if (index(2) == 1) scene.young = 1.0 + 1e5 * unit();
  scene.poisson = -0.9 + 1.39 * unit();
  scene.density = 1.0 + 2000.0 * unit();
  scene.damping = 10.0 * unit();
  scene.damping_frequency = 1.0 + 10.0 * unit();
  if (index(2) == 1) scene.height = 0.1 + unit();
  scene.output_space = index(2) == 1 ? OutputSpace::Si : OutputSpace::File;
  scene.gravity = {unit(), -10.0 * unit(), 1e-7 * unit()};
  scene.step = 1e-6 + 0.09 * unit();
  scene.integrator = static_cast<Integrator>(index(4));
  if (index(2) == 1) scene.model = "neo-hookean";
  if (index(4) > 0) scene.precision = static_cast<Precision>(index(3));
  scene.fps = 1.0 + 100.0 * unit();
  if (index(2) == 1) scene.offset = 10.0 * unit();
  if (index(2) == 1) scene.frames = FrameRange{index(10), 10 + index(10)};
  scene.settle = 10.0 * unit();
  scene.threads = index(64);
  if (index(2) == 1) scene.output_mesh = text();
  for (int i = index(3); i > 0; --i) {
    scene.materials.push_back({{text(), text()}, 1.0 + unit(), std::nullopt, 500.0 * (1.0 + unit())});
    if (index(2) == 1) scene.materials.back().radius = 1e-3 + unit();
    if (index(2) == 1) scene.materials.back().stiffness = 100.0 * unit();
    if (index(2) == 1) scene.materials.back().region = text();
    if (!built && index(2) == 1) scene.materials.push_back({{}, 1e4, {}, {}, {}, {}, {}, {text(), "7"}});
  }
  return scene;
}

TEST_F(SceneFile, ReadsBackExactlyWhatIsPrinted) {
  std::mt19937_64 rng(20021);
  for (int i = 0; i < 200; ++i) {
    const Scene scene = random_scene(rng);
    scene.validate();
    const std::string text = print_scene(scene);
    EXPECT_EQ(read(text), scene) << text;
  }
  EXPECT_EQ(read(print_scene(Scene{})), Scene{});
}

TEST_F(SceneFile, GivesAValidSceneOrANamedErrorHoweverTheTextIsDamaged) {
  std::mt19937_64 rng(20023);
  const auto index = [&](std::size_t n) { return static_cast<std::size_t>(rng() % n); };
  const std::vector<std::string> tokens{"\"",    "'''",  "[",   "]]",       "{",    "=", "\n",
                                        "1e999", "-0x1", "nan", "material", "\xFF", ","};
  int num_read = 0, num_refused = 0;
  for (int i = 0; i < 1000; ++i) {
    std::string text = print_scene(random_scene(rng));
    for (std::size_t edits = 1 + index(3); edits > 0; --edits) {
      const std::size_t at = index(text.size());
      switch (index(4)) {
        case 0:
          text[at] = static_cast<char>(rng() & 0xFF);
          break;
        case 1:
          text.erase(at, index(20));
          break;
        case 2:
          text.insert(at, text.substr(index(text.size()), 20));
          break;
        default:
          text.insert(at, tokens[index(tokens.size())]);
      }
    }
    try {
      read(text).validate();
      ++num_read;
    } catch (const assets::ConfigError& e) {
      EXPECT_EQ(std::string(e.what()).rfind("scene.toml:", 0), 0u) << e.what();
      ++num_refused;
    }  // anything else fails the test
  }
  EXPECT_GT(num_read, 100);  // damage to a comment or a name leaves a scene
  EXPECT_GT(num_refused, 100);
}

TEST_F(SceneFile, IsReadAndPrintedTheSameWhereTheLocaleWritesCommas) {
  std::mt19937_64 rng(20022);
  const Scene scene = random_scene(rng);
  const std::string text = print_scene(scene);
  const CommaLocale comma;
  EXPECT_EQ(print_scene(scene), text);
  EXPECT_EQ(read(text), scene);
  Scene from_flag;
  set_from_text(from_flag, *find_scene_field("poisson"), "0.25", "--poisson");
  EXPECT_EQ(from_flag.poisson, 0.25);
  EXPECT_EQ(refusal("poisson = 0.75"), "scene.toml:1: poisson: got 0.75, expected -1 < nu < 0.5; hint: 0.49");
}

TEST_F(SceneFile, PrintsEveryKey) {
  const std::string text = print_scene(Scene{});
  for (const SceneField& field : scene_fields()) {
    EXPECT_NE(text.find(std::string(field.key) + " ="), std::string::npos) << field.key;
  }
  EXPECT_NE(text.find("# Poisson's ratio; -1 < nu < 0.5\npoisson = 0.45\n"), std::string::npos) << text;
  EXPECT_NE(text.find("\nstep = \"1/120\"\n"), std::string::npos) << text;
  EXPECT_NE(text.find("integrator = \"bdf2\"\n"), std::string::npos) << text;
}

TEST_F(SceneFile, CannotPrintANameThatIsNotUtf8) {
  Scene scene;
  scene.rig = "hero\xFF.glb";
  try {
    print_scene(scene);
    FAIL() << "printed";
  } catch (const assets::ConfigError& e) {
    EXPECT_STREQ(
        e.what(),
        "rig: got 'hero\\xff.glb', expected UTF-8; hint: rename the file, TOML cannot hold the name");
  }
}
}  // namespace
}  // namespace sinew::tools
