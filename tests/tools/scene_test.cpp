#include "tools/scene/scene.h"

#include <filesystem>
#include <functional>
#include <string>

#include <gtest/gtest.h>

#include "assets/error.h"
#include "fem/models/model.h"
#include "tests/tools/scene_file.h"
#include "tools/scene/scene_fields.h"

namespace sinew::tools {
namespace {

/// The names that a message lists; the registry grows.
std::string model_list() {
  std::string list;
  for (const fem::ModelInfo& model : fem::models()) list.append(list.empty() ? "" : ", ").append(model.name);
  return list;
}

namespace fs = std::filesystem;

TEST_F(SceneFile, ReadsWhichBonesTakePartAndHowLargeCellsAre) {
  const Scene scene =
      read("bones_include = [\"arm*\", \"leg_?\"]\nbones_exclude = [\"toe*\"]\ncell_size = 0.05");
  EXPECT_EQ(scene.bones_include, (std::vector<std::string>{"arm*", "leg_?"}));
  EXPECT_EQ(scene.bones_exclude, std::vector<std::string>{"toe*"});
  EXPECT_EQ(scene.cell_size, 0.05);
  EXPECT_EQ(refusal("bones_include = \"arm\""),
            "scene.toml:1: bones_include: got a string, expected an array of strings");
}

TEST_F(SceneFile, ReadsToWhichFramesTheCharacterIsCut) {
  EXPECT_EQ(read("cuts = [31, 60]").cuts, (std::vector<int>{31, 60}));
  EXPECT_TRUE(read("cuts = []").cuts.empty());
  EXPECT_EQ(
      refusal("cuts = 31"),
      "scene.toml:1: cuts: got a whole number, expected an array of whole numbers, 1 <= frame <= 10000000");
  EXPECT_EQ(refusal("cuts = [31, 1.5]"),
            "scene.toml:1: cuts: got a number, expected a whole number, 1 <= frame <= 10000000");
  EXPECT_EQ(refusal("cuts = [0]"), "scene.toml:1: cuts: got 0, expected 1 <= frame <= 10000000; hint: 31");
  // As flags have it, and as a printed scene does.
  Scene scene;
  const SceneField& field = *find_scene_field("cuts");
  set_from_text(scene, field, "31, 60", "--cuts");
  EXPECT_EQ(scene.cuts, (std::vector<int>{31, 60}));
  EXPECT_EQ(flag_text(scene, field), "31,60");
  EXPECT_EQ(toml_value(scene, field), "[31, 60]");
  EXPECT_THROW(set_from_text(scene, field, "31,x", "--cuts"), assets::ConfigError);
}

TEST_F(SceneFile, TakesRegionsOfALatticeByNameAndNumber) {
  const Scene scene = read("lattice = \"a.msh\"\n[[material]]\nregions = [\"belly\", 7]\nyoung = 100.0");
  EXPECT_EQ(scene.materials.at(0).regions, (std::vector<std::string>{"belly", "7"}));
  Scene other = scene;
  other.materials[0].radius = 0.1;
  const auto message = [](const Scene& wrong) -> std::string {
    try {
      wrong.validate();
    } catch (const assets::ConfigError& e) {
      return e.what();
    }
    return "accepted";
  };
  EXPECT_EQ(message(scene), "accepted");
  EXPECT_EQ(
      message(other),
      "material 1: regions of a lattice, expected no bones, radius, stiffness or region with them; hint: "
      "two materials");
  other = scene;
  other.lattice.clear();
  EXPECT_EQ(message(other),
            "scene.toml: material 1: regions, expected none as a lattice that is built has none; hint: "
            "bones, or a lattice "
            "of your own");
  EXPECT_EQ(refusal("[[material]]\nregions = 7"),
            "scene.toml:2: material 1: regions: got a whole number, expected an array of names or numbers of "
            "regions");
}

TEST_F(SceneFile, SaysWhatIsWrongWithSizes) {
  EXPECT_EQ(refusal("[[size]]\nbones = [\"a\"]\nfactor = 5"),
            "scene.toml:3: size 1: factor: got 5, expected 0.25 <= factor <= 4; hint: 0.5");
  EXPECT_EQ(refusal("[[size]]\nbones = [\"a\"]"),
            "scene.toml:1: size 1: no factor, expected bones and a factor; hint: bones = [\"belly*\"], "
            "factor = 0.5");
  EXPECT_EQ(refusal("[[size]]\nfactr = 0.5"), "scene.toml:2: factr: unknown key; hint: did you mean factor?");
}

TEST_F(SceneFile, SaysWhatIsWrongWithRoles) {
  EXPECT_EQ(
      refusal("[[part]]\nname = \"eye*\"\nrole = \"stiff\""),
      "scene.toml:3: part 1: role: got 'stiff', expected flesh, skinned, rigid or riding; hint: skinned");
  EXPECT_EQ(refusal("[[part]]\nrole = \"rigid\""),
            "scene.toml:1: part 1: no name, expected a name and a role; hint: name = \"sword*\", role = "
            "\"skinned\"");
  EXPECT_EQ(refusal("[[bone]]\nname = \"head\"\nrole = \"riding\"\nsoft = true"),
            "scene.toml:4: soft: unknown key; hint: known are name, role");
  // Bones with places belong to a box.
  EXPECT_EQ(refusal("[[bone]]\nstart = [0, 0, 0]\nend = [1, 0, 0]"),
            "scene.toml: [lattice]: missing, expected a box; hint: bones, fixed faces, loads and velocities "
            "belong to scenes without a rig, whose flesh is a box");
}

TEST_F(SceneFile, KeepsTheDefaultsOfKeysLeftOut) { EXPECT_EQ(read(""), Scene{}); }

TEST_F(SceneFile, SetsEveryKey) {
  const Scene scene = read(R"(
rig = "hero.glb"
output = "out/hero"
overwrite = true
json = true
strict = true
clip = "walk"
cells = 500
tip_bones = "off"
symmetry = "off"
grade = "off"
coarsen_rigid = "on"
guard = "off"
preview = "off"
levels = 2
young = 20000
poisson = 0.49
density = 950.5
damping = 0.05
damping_frequency = 4
height = 1.8
output_space = "si"
gravity = [0, 0, -9.81]
step = "1/240"
integrator = "backward-euler"
model = "skin"
precision = "float"
fps = 23.976
frames = "3-47"
settle = 0
offset = 0.5
threads = 2
output_mesh = "hero.obj"

[[material]]
bones = ["tail*", "ear_?"]
young = 5000.0

[[size]]
bones = ["belly", "hip*"]
factor = 0.5

[[part]]
name = "body/head*"
role = "riding"

[[bone]]
name = "hand.R"
role = "rigid"

[[part]]
name = "hair"
role = "flesh"

[[material]]
bones = ["belly"]
poisson = 0.3
density = 900
radius = 0.02
stiffness = 40
region = "trunk"
)");
  Scene expected;
  expected.rig = "hero.glb";
  expected.output = "out/hero";
  expected.overwrite = true;
  expected.json = true;
  expected.strict = true;
  expected.clip = "walk";
  expected.cells = 500;
  expected.tip_bones = expected.symmetry = expected.preview = Switch::Off;
  expected.guard = Switch::Off;
  expected.grade = Switch::Off;
  expected.coarsen_rigid = Switch::On;
  expected.sizes = {{{"belly", "hip*"}, 0.5}};
  expected.part_roles = {{"body/head*", assets::PartRole::Riding}, {"hair", assets::PartRole::Simulated}};
  expected.bone_roles = {{"hand.R", assets::PartRole::Rigid}};
  expected.levels = 2;
  expected.young = 20000.0;
  expected.poisson = 0.49;
  expected.density = 950.5;
  expected.damping = 0.05;
  expected.damping_frequency = 4.0;
  expected.height = 1.8;
  expected.output_space = OutputSpace::Si;
  expected.gravity = {0.0, 0.0, -9.81};
  expected.step = 1.0 / 240.0;
  expected.integrator = Integrator::BackwardEuler;
  expected.model = "skin";
  expected.precision = Precision::Float;
  expected.fps = 23.976;
  expected.frames = FrameRange{3, 47};
  expected.offset = 0.5;
  expected.settle = 0.0;
  expected.threads = 2;
  expected.output_mesh = "hero.obj";
  expected.materials = {{{"tail*", "ear_?"}, 5000.0, {}, {}},
                        {{"belly"}, {}, 0.3, 900.0, 0.02, 40.0, "trunk", {}}};
  EXPECT_EQ(scene, expected);
}

TEST_F(SceneFile, TakesPathsRelativeToItself) {
  fs::create_directory("scenes");
  const Scene scene =
      read("rig = \"hero.glb\"\nlattice = \"/cages/hero.vtu\"\nclip = \"a/b\"\n", "scenes/hero.toml");
  EXPECT_EQ(scene.rig, "scenes/hero.glb");
  EXPECT_EQ(scene.lattice, "/cages/hero.vtu");
  EXPECT_EQ(scene.clip, "a/b");  // a name, not a path
}

TEST_F(SceneFile, ReportsWhatIsWrongWithLineValueRangeAndRemedy) {
  struct Case {
    const char* text;
    std::string message;
  };
  const Case cases[] = {
      {"poisson = 0.5", "scene.toml:1: poisson: got 0.5, expected -1 < nu < 0.5; hint: 0.49"},
      {"\n\npoisson = -1.0", "scene.toml:3: poisson: got -1, expected -1 < nu < 0.5; hint: 0.49"},
      {"poisson = nan", "scene.toml:1: poisson: got nan, expected -1 < nu < 0.5; hint: 0.49"},
      {"young = 0",
       "scene.toml:1: young: got 0, expected 0.001 <= E <= 1e+12 Pa; hint: leave it out for the "
       "automatic "
       "value"},
      {"young = \"10 kPa\"",
       "scene.toml:1: young: got the string '10 kPa', expected a number, 0.001 <= E <= 1e+12 Pa; "
       "hint: no "
       "quotes and no unit"},
      {"density = 0", "scene.toml:1: density: got 0, expected 1 <= rho <= 100000 kg/m^3; hint: 1000"},
      {"damping = -0.1", "scene.toml:1: damping: got -0.1, expected 0 <= zeta <= 10; hint: 0.1"},
      {"step = 1e9", "scene.toml:1: step: got 1000000000, expected 1e-06 <= h <= 0.1 s; hint: 1/120"},
      {"step = \"1/0\"",
       "scene.toml:1: step: got '1/0', expected a number or a fraction of two, 1e-06 <= h <= 0.1 s"},
      {"gravity = [0, inf, 0]",
       "scene.toml:1: gravity: got inf, expected -10000 <= each component <= 10000 m/s^2; hint: 0,-9.81,0"},
      {"gravity = [0, -9.81]", "scene.toml:1: gravity: got an array, expected an array of three numbers"},
      {"fps = true", "scene.toml:1: fps: got a boolean, expected a number, 0.1 <= fps <= 10000 1/s"},
      {"levels = 4", "scene.toml:1: levels: got 4, expected 0 <= levels <= 3; hint: 1"},
      {"levels = 1.0", "scene.toml:1: levels: got a number, expected a whole number, 0 <= levels <= 3"},
      {"threads = -1", "scene.toml:1: threads: got -1, expected 0 <= threads <= 1024; hint: 0"},
      {"frames = \"5-2\"",
       "scene.toml:1: frames: got 5-2, expected A-B with 0 <= A <= B <= 10000000; hint: 0-47"},
      {"frames = \"first\"",
       "scene.toml:1: frames: got 'first', expected A-B, two frame numbers; hint: 0-47"},
      {"integrator = \"bdf3\"",
       "scene.toml:1: integrator: got 'bdf3', expected bdf2, backward-euler, tr-bdf2 or implicit-midpoint; "
       "hint: bdf2"},
      {"model = \"blendde\"",
       "scene.toml:1: model: got 'blendde', expected one of " + model_list() + "; hint: blended"},
      {"model = \"magic\"",
       "scene.toml:1: model: got 'magic', expected one of " + model_list() + "; hint: blended-stiffness"},
      {"clip = 3", "scene.toml:1: clip: got a whole number, expected a string"},
      {"overwrite = 1", "scene.toml:1: overwrite: got a whole number, expected true or false"},
      {"rig = \"a.glb\"\ndampnig = 0.1", "scene.toml:2: dampnig: unknown key; hint: did you mean damping?"},
      {"[material]\nbones = [\"a\"]", "scene.toml:1: material: got a table, expected tables, [[material]]"},
      {"[[material]]\nyuong = 3\nbones = [\"a\"]",
       "scene.toml:2: yuong: unknown key; hint: did you mean young?"},
      {"[[material]]\nyoung = 3.0",
       "scene.toml:1: material 1: no bones, expected at least one name or pattern; hint: bones = "
       "[\"tail*\"]"},
      {"[[material]]\nbones = [\"a\"]\n\npoisson = 0.7",
       "scene.toml:4: material 1: poisson: got 0.7, expected -1 < nu < 0.5; hint: 0.49"},
      {"[[material]]\nbones = \"a\"",
       "scene.toml:2: material 1: bones: got a string, expected an array of strings"},
  };
  for (const auto& [text, message] : cases) EXPECT_EQ(refusal(text), message) << "scene: " << text;
}

TEST_F(SceneFile, ListsTheKnownKeysWhereNoneIsNear) {
  const std::string message = refusal("temperature = 3");
  EXPECT_EQ(message.rfind(
                "scene.toml:1: temperature: unknown key; hint: known are body_load, bone, bones_exclude,", 0),
            0u)
      << message;
}

TEST_F(SceneFile, ReportsTheFirstWrongLineAndNotTheFirstWrongKey) {
  EXPECT_EQ(refusal("young = -1\ndamping = -1\n").rfind("scene.toml:1: young", 0), 0u);
}

TEST_F(SceneFile, RefusesDuplicateKeysAndBrokenTomlWithLineAndColumn) {
  EXPECT_EQ(refusal("cells = 30\ncells = 40\n").rfind("scene.toml:2:", 0), 0u)
      << refusal("cells = 30\ncells = 40\n");
  EXPECT_EQ(refusal("cells = 9223372036854775807000\n").rfind("scene.toml:1:", 0), 0u);
  EXPECT_EQ(refusal("cells = = 3\n").rfind("scene.toml:1:", 0), 0u);
  EXPECT_EQ(refusal("cells = 1,5\n").rfind("scene.toml:1:", 0), 0u);
  EXPECT_EQ(refusal("a = " + std::string(100000, '[')).rfind("scene.toml:1:", 0), 0u);
}

TEST_F(SceneFile, ReportsFilesThatCannotBeRead) {
  try {
    read_scene("missing.toml");
    FAIL() << "accepted";
  } catch (const assets::IoError& e) {
    EXPECT_EQ(std::string(e.what()),
              "missing.toml: not found (" + (fs::current_path() / "missing.toml").string() + ")");
  }
  fs::create_directory("folder.toml");
  try {
    read_scene("folder.toml");
    FAIL() << "accepted";
  } catch (const assets::IoError& e) {
    EXPECT_STREQ(e.what(), "folder.toml: not a regular file");
  }
  EXPECT_THROW(read_scene("/dev/zero"), assets::IoError);
  EXPECT_EQ(refusal(std::string((1 << 20) + 1, '#')),
            "scene.toml: longer than 1048576 bytes, expected a scene in TOML");
}

TEST_F(SceneFile, StopsAtTheLimitOfCells) {
  try {
    read("cells = 100000000");
    FAIL() << "accepted";
  } catch (const assets::LimitError& e) {
    EXPECT_STREQ(e.what(),
                 "scene.toml:1: cells: got 100000000, the limit is 1000000 cells; that many would need at "
                 "least 300 GB "
                 "of memory; hint: 1000 cells suffice for most characters");
  }
}

TEST_F(SceneFile, WarnsOfWhatIsOutsideOfTheTestedRange) {
  EXPECT_TRUE(outside_envelope(Scene{}).empty());
  Scene scene = read("step = 1e-6\nyoung = 1e3\n[[material]]\nbones = [\"a\"]\nyoung = 1e12\n");
  EXPECT_EQ(outside_envelope(scene),
            (std::vector<std::string>{
                "step: got 1e-06 s, outside of 1e-05 ... 0.1, where every model is tested",
                "material 1: young: got 1e+12 Pa, outside of 1000 ... 1e+09, where every model is tested"}));
}

TEST(SceneValues, AreCheckedWhereverTheyComeFrom) {
  const auto refusal = [](const std::function<void(Scene&)>& change) -> std::string {
    Scene scene;
    change(scene);
    try {
      scene.validate();
    } catch (const assets::ConfigError& e) {
      return e.what();
    }
    return "accepted";
  };
  EXPECT_EQ(refusal([](Scene&) {}), "accepted");
  EXPECT_EQ(refusal([](Scene& s) { s.poisson = 0.5; }),
            "poisson: got 0.5, expected -1 < nu < 0.5; hint: 0.49");
  EXPECT_EQ(refusal([](Scene& s) { s.poisson = 0.4999; }), "accepted");
  EXPECT_EQ(refusal([](Scene& s) {
              s.materials = {{{"a"}, {}, 0.5, {}}};
            }),
            "material 1: poisson: got 0.5, expected -1 < nu < 0.5; hint: 0.49");
  EXPECT_EQ(refusal([](Scene& s) {
              s.materials = {{{}, 3.0, {}, {}}};
            }),
            "material 1: no bones, expected at least one name");
}

TEST(SceneMaterials, FindTheBonesByPattern) {
  Scene scene;
  scene.materials = {{{"*"}, 1.0, {}, {}}, {{"tail_?", "ear*l"}, 2.0, {}, {}}, {{"tail_2"}, 3.0, {}, {}}};
  EXPECT_EQ(
      bones_of_materials(scene, "r.glb", {"tail_1", "tail_2", "tail_10", "ear_tip_l", "ear_tip_r", "earl"}),
      (std::vector<std::vector<int>>{{0, 1, 2, 3, 4, 5}, {0, 1, 3, 5}, {1}}));
}

TEST(SceneMaterials, OfAMergedJointAreForTheBonesItWasMergedInto) {
  Scene scene;
  scene.materials = {{{"toe", "hip"}, 1.0, {}, {}}, {{"*o*"}, 2.0, {}, {}}};
  std::vector<std::string> said;
  EXPECT_EQ(bones_of_materials(scene, "r.glb", {"hip", "foot", "foot.tip"}, {{"toe", "foot", {1, 2}}},
                               [&](const std::string& line) { said.push_back(line); }),
            (std::vector<std::vector<int>>{{0, 1, 2}, {1, 2}}));
  // Where a pattern fits bones, those are meant.
  EXPECT_EQ(said,
            std::vector<std::string>{"material 1: the lattice has no bone for joint 'toe'; the flesh of "
                                     "'foot' is meant, into which it was merged"});
}

TEST(SceneMaterials, RefuseAPatternThatFitsNoBone) {
  Scene scene;
  scene.materials = {{{"hip"}, 1.0, {}, {}}, {{"tial*"}, 2.0, {}, {}}};
  try {
    bones_of_materials(scene, "r.glb", {"hip", "tail"});
    FAIL() << "accepted";
  } catch (const assets::InputError& e) {
    EXPECT_STREQ(e.what(), "r.glb: material 2: no bone is named 'tial*'; hint: did you mean tail*?");
  }
}

// What libraries say in a scene's words reads as flags at the terminal.
TEST(SceneFields, KeysInBackquotesBecomeFlags) {
  EXPECT_EQ(with_flags("a longer `step` or `soft_bones`"), "a longer --step or --soft-bones");
  EXPECT_EQ(with_flags("`no_key` and a lone ` stay"), "`no_key` and a lone ` stay");
  EXPECT_EQ(with_flags(""), "");
}

}  // namespace
}  // namespace sinew::tools
