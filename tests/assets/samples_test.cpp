#include "tools/make_samples/samples.h"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <numbers>
#include <set>

#include <gtest/gtest.h>

#include "assets/rig.h"
#include "tools/make_samples/exact_math.h"
#include "tools/make_samples/motion.h"

namespace sinew::samples {
namespace {

using Eigen::Vector3d;

/// What the generator makes, made once per run of this program.
const assets::GlbScene& once(assets::GlbScene (*make)()) {
  static std::map<assets::GlbScene (*)(), assets::GlbScene> made;
  const auto found = made.find(make);
  return found != made.end() ? found->second : made.emplace(make, make()).first->second;
}

std::string sample_file(const std::string& name) {
  return std::string(SINEW_SOURCE_DIR) + "/assets/samples/" + name + ".glb";
}

std::string read_bytes(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  EXPECT_TRUE(stream) << file;
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// All primitives of a mesh joined at equal positions.
struct Joined {
  std::map<std::array<double, 3>, int> index;
  std::vector<std::array<int, 3>> triangles;
};

Joined join(const assets::GlbMesh& mesh) {
  Joined joined;
  for (const assets::GlbPrimitive& primitive : mesh.primitives) {
    for (Eigen::Index t = 0; t < primitive.triangles.rows(); ++t) {
      std::array<int, 3> corners;
      for (int c = 0; c < 3; ++c) {
        const Vector3d p = primitive.points.row(primitive.triangles(t, c));
        corners[static_cast<std::size_t>(c)] =
            joined.index.emplace(std::array<double, 3>{p.x(), p.y(), p.z()}, joined.index.size())
                .first->second;
      }
      joined.triangles.push_back(corners);
    }
  }
  return joined;
}

/// Directed edges with the number of triangles that have them.
std::map<std::pair<int, int>, int> directed_edges(const Joined& mesh) {
  std::map<std::pair<int, int>, int> edges;
  for (const auto& t : mesh.triangles)
    for (std::size_t c = 0; c < 3; ++c) ++edges[{t[c], t[(c + 1) % 3]}];
  return edges;
}

void expect_closed(const Joined& mesh) {
  const auto edges = directed_edges(mesh);
  int wrong = 0;
  for (const auto& [edge, count] : edges)
    if (count != 1 || edges.count({edge.second, edge.first}) == 0) ++wrong;
  EXPECT_EQ(wrong, 0);
  // A closed surface in one piece without handles: V - E + F = 2.
  EXPECT_EQ(static_cast<long>(mesh.index.size()) - static_cast<long>(edges.size() / 2) +
                static_cast<long>(mesh.triangles.size()),
            2);
}

double signed_volume(const assets::GlbMesh& mesh) {
  double volume = 0.0;
  for (const assets::GlbPrimitive& p : mesh.primitives)
    for (Eigen::Index t = 0; t < p.triangles.rows(); ++t) {
      const Vector3d a = p.points.row(p.triangles(t, 0)), b = p.points.row(p.triangles(t, 1)),
                     c = p.points.row(p.triangles(t, 2));
      volume += a.dot(b.cross(c)) / 6.0;
    }
  return volume;
}

double height(const assets::GlbMesh& mesh) {
  double low = 1e9, high = -1e9;
  for (const auto& p : mesh.primitives) {
    low = std::min(low, p.points.col(1).minCoeff());
    high = std::max(high, p.points.col(1).maxCoeff());
  }
  return high - low;
}

const skeleton::Clip& clip(const assets::GlbScene& scene, const std::string& name) {
  for (const auto& c : scene.clips)
    if (c.name == name) return c;
  throw std::out_of_range("no clip " + name);
}

/// Angle [degrees] that a joint has turned through by the end of the clip.
double final_angle(const skeleton::Clip& c, int joint) {
  for (const auto& channel : c.channels)
    if (channel.joint == joint && channel.rotation)
      return 2.0 * std::acos(std::abs(channel.rotation->values.back().w())) * 180.0 / std::numbers::pi;
  return 0.0;
}

int node(const assets::GlbScene& scene, const std::string& name) {
  for (std::size_t n = 0; n < scene.nodes.size(); ++n)
    if (scene.nodes[n].name == name) return static_cast<int>(n);
  throw std::out_of_range("no node " + name);
}

const std::array<std::pair<const char*, assets::GlbScene (*)()>, 3> kSamples = {
    {{"arm", make_arm}, {"hopper", make_hopper}, {"patchwork", make_patchwork}}};

TEST(Samples, TheCommittedFilesAreWhatTheGeneratorMakes) {
  for (const auto& [name, make] : kSamples)
    EXPECT_TRUE(read_bytes(sample_file(name)) == assets::glb_bytes(once(make)))
        << name << ".glb: run sinew-make-samples assets/samples and look at the result before committing it";
}

TEST(Samples, StayWithinThreeMegabytes) {
  std::uintmax_t total = 0;
  for (const auto& [name, make] : kSamples) total += std::filesystem::file_size(sample_file(name));
  EXPECT_LT(total, 3'000'000u);
}

TEST(Samples, SkinsAreClosedAndTurnedOutwards) {
  for (const auto& [name, make] : kSamples) {
    SCOPED_TRACE(name);
    const assets::GlbScene& scene = once(make);
    expect_closed(join(scene.meshes[0]));
    EXPECT_GT(signed_volume(scene.meshes[0]), 0.0);
  }
}

TEST(Samples, SkinsAreSymmetricInPlaceAndWeights) {
  for (const auto& [name, make] : kSamples) {
    SCOPED_TRACE(name);
    const assets::GlbScene& scene = once(make);
    std::vector<SampleJoint> joints;
    for (const int j : scene.joints)
      joints.push_back({scene.nodes[static_cast<std::size_t>(j)].name, "", {}});
    const std::vector<int> mirror = mirror_joints(joints);
    // Position and weights as a set: the mirrored set must be the same one, to the last bit.
    std::set<std::pair<std::array<double, 3>, std::map<int, double>>> vertices, images;
    for (const auto& primitive : scene.meshes[0].primitives) {
      for (Eigen::Index v = 0; v < primitive.points.rows(); ++v) {
        std::map<int, double> weights, mirrored;
        for (const auto& influence : primitive.weights[static_cast<std::size_t>(v)]) {
          weights[influence.frame] = to_grid(influence.weight);
          mirrored[mirror[static_cast<std::size_t>(influence.frame)]] = to_grid(influence.weight);
        }
        const Vector3d p = primitive.points.row(v);
        vertices.insert({{p.x() + 0.0, p.y(), p.z()}, weights});
        images.insert({{-p.x() + 0.0, p.y(), p.z()}, mirrored});
      }
    }
    EXPECT_TRUE(vertices == images);
  }
}

TEST(Samples, EveryVertexHasOneToFourWeightsThatSumToOne) {
  for (const auto& [name, make] : kSamples) {
    const assets::GlbScene& scene = once(make);
    for (const auto& mesh : scene.meshes) {
      for (const auto& primitive : mesh.primitives) {
        for (const auto& influences : primitive.weights) {
          ASSERT_GE(influences.size(), 1u) << name;
          ASSERT_LE(influences.size(), 4u) << name;
          double sum = 0.0;
          for (const auto& influence : influences) sum += influence.weight;
          // Weights sit on a grid of 1e-6, four of them are off by half of that at most.
          ASSERT_NEAR(sum, 1.0, 2e-6) << name << ", " << mesh.name;
        }
      }
    }
  }
}

TEST(Samples, AreReadBackAsTheyWereMade) {
  for (const auto& [name, make] : kSamples) {
    SCOPED_TRACE(name);
    const assets::GlbScene& scene = once(make);
    const assets::Rig rig = assets::load_rig(sample_file(name), {.importer_executable = SINEW_IMPORTER});
    for (const assets::Finding& finding : rig.findings)
      EXPECT_EQ(finding.severity, assets::Finding::Severity::Info) << finding.code << ": " << finding.message;
    EXPECT_EQ(rig.metres_per_unit, 1.0);
    EXPECT_TRUE(rig.file_vertex_order);
    ASSERT_EQ(rig.clips.size(), scene.clips.size());
    for (std::size_t c = 0; c < rig.clips.size(); ++c) {
      EXPECT_EQ(rig.clips[c].name, scene.clips[c].name);
      EXPECT_NEAR(rig.clips[c].duration(), scene.clips[c].duration(),
                  1e-6);  // times are floats of a few seconds
      EXPECT_EQ(rig.clips[c].num_keys, scene.clips[c].num_keys);
    }
    for (const int j : scene.joints)
      EXPECT_GE(rig.skeleton.find(scene.nodes[static_cast<std::size_t>(j)].name), 0);
    // Every simulated part is a primitive of a skinned mesh, positions and weights as they were.
    std::vector<const assets::GlbPrimitive*> skinned;
    for (const auto& n : scene.nodes)
      if (n.skinned)
        for (const auto& primitive : scene.meshes[static_cast<std::size_t>(n.mesh)].primitives)
          skinned.push_back(&primitive);
    std::size_t next = 0;
    for (const assets::Part& part : rig.parts) {
      if (part.role != assets::PartRole::Simulated) continue;
      ASSERT_LT(next, skinned.size());
      const assets::GlbPrimitive& primitive = *skinned[next++];
      // The reader skins the mesh in its bind pose: matrices stored as floats of up to 1.4 m, half a unit in
      // the last place is 6e-8 m, a few of them add up.
      EXPECT_LT((part.points - primitive.points).cwiseAbs().maxCoeff(), 5e-7) << part.name;
      EXPECT_TRUE(part.triangles == primitive.triangles) << part.name;
      for (std::size_t v = 0; v < part.weights.size(); ++v) {
        double sum = 0.0;
        for (const auto& influence : part.weights[v]) sum += influence.weight;
        ASSERT_NEAR(sum, 1.0, 1e-15);  // whole shares of 65535 that add up
        ASSERT_LE(part.weights[v].size(), primitive.weights[v].size());
      }
    }
    EXPECT_EQ(next, skinned.size());
  }
}

TEST(Arm, HasTwoBonesAndAHandlikeLimbOfItsSize) {
  const assets::GlbScene& scene = once(make_arm);
  ASSERT_EQ(scene.meshes.size(), 1u);
  const auto& skin = scene.meshes[0].primitives.at(0);
  EXPECT_GT(skin.points.rows(), 1500);
  EXPECT_LT(skin.points.rows(), 3000);
  EXPECT_NEAR(height(scene.meshes[0]), 0.65, 0.05);
  std::set<int> weighted;
  for (const auto& influences : skin.weights)
    for (const auto& influence : influences) weighted.insert(influence.frame);
  EXPECT_EQ(weighted, (std::set<int>{0, 1}));
}

TEST(Arm, BendsTo120DegreesAndTwistsBy90AndHolds) {
  const assets::GlbScene& scene = once(make_arm);
  const int forearm = node(scene, "forearm");
  EXPECT_NEAR(final_angle(clip(scene, "elbow"), forearm), 120.0, 1e-6);
  EXPECT_NEAR(final_angle(clip(scene, "twist"), forearm), 90.0, 1e-6);
  EXPECT_NEAR(clip(scene, "elbow").duration(), 2.4, 1e-9);
  // Held for the last second and more: the flesh has time to ring out.
  for (const auto& c : scene.clips) {
    const auto& turn = *c.channels.at(0).rotation;
    const std::size_t one_second_before = turn.values.size() - 61;
    EXPECT_EQ(turn.values[one_second_before].coeffs(), turn.values.back().coeffs()) << c.name;
  }
}

TEST(Hopper, IsOneSkinOfTheSizeOfAChildOn20JointsOrMore) {
  const assets::GlbScene& scene = once(make_hopper);
  ASSERT_EQ(scene.meshes.size(), 1u);
  ASSERT_EQ(scene.meshes[0].primitives.size(), 1u);
  EXPECT_GE(scene.joints.size(), 20u);
  const auto& skin = scene.meshes[0].primitives[0];
  EXPECT_GE(skin.points.rows(), 3000);
  EXPECT_LE(skin.points.rows(), 8000);
  EXPECT_GT(height(scene.meshes[0]), 1.2);
  EXPECT_LT(height(scene.meshes[0]), 1.6);
  EXPECT_NEAR(skin.points.col(1).minCoeff(), 0.0, 0.01);  // stands on the ground
}

TEST(Hopper, LegsDoNotPullAtEachOther) {
  const assets::GlbScene& scene = once(make_hopper);
  const auto& skin = scene.meshes[0].primitives[0];
  for (Eigen::Index v = 0; v < skin.points.rows(); ++v)
    for (const auto& influence : skin.weights[static_cast<std::size_t>(v)]) {
      const std::string& name = scene.nodes[static_cast<std::size_t>(influence.frame)].name;
      for (const std::string joint : {"shin", "foot", "toe", "forearm", "hand"}) {
        if (name == joint + "_l") {
          EXPECT_GT(skin.points(v, 0), 0.0) << name;
        }
        if (name == joint + "_r") {
          EXPECT_LT(skin.points(v, 0), 0.0) << name;
        }
      }
    }
}

TEST(Hopper, KeepsItsFeetOnTheGroundWhileItStands) {
  const assets::GlbScene& scene = once(make_hopper);
  std::vector<skeleton::Joint> joints;
  for (const int j : scene.joints) {
    const assets::GlbNode& n = scene.nodes[static_cast<std::size_t>(j)];
    joints.push_back({n.name, n.parent, n.local.matrix(), n.local, Eigen::Affine3d::Identity()});
  }
  const skeleton::Skeleton skeleton(joints);
  const skeleton::Clip& hop = clip(scene, "hop");
  const auto toe_at = [&](double t) {
    return Vector3d(skeleton::sample(skeleton, hop, t)
                        .world_from_joint[static_cast<std::size_t>(skeleton.find("toe_l"))]
                        .translation());
  };
  const Vector3d rest = toe_at(0.0);
  double highest = 0.0;
  for (int k = 0; k <= 168; ++k) {
    const double t = k / 60.0;
    const bool standing = t < 0.40 || (t > 0.89 && t < 1.25) || t > 1.75;
    // The leg is placed by inverse kinematics at every key; the angles are found to 180 / 2^50 degrees, the
    // keys are rounded to 1e-6 m.
    if (standing) {
      EXPECT_NEAR((toe_at(t) - rest).norm(), 0.0, 2e-6) << "t = " << t;
    }
    highest = std::max(highest, toe_at(t).y() - rest.y());
  }
  EXPECT_GT(highest, 0.2);  // it does hop
  EXPECT_NEAR(clip(scene, "look").duration(), 2.6, 1e-9);
}

TEST(Patchwork, HasSeveralPartsOpenSheetsRigidEyesAndJointsWithoutWeight) {
  const assets::GlbScene& scene = once(make_patchwork);
  EXPECT_GE(scene.meshes[0].primitives.size(), 3u);
  for (const std::string name : {"skirt", "cape"}) {
    const auto& mesh =
        scene.meshes[static_cast<std::size_t>(scene.nodes[static_cast<std::size_t>(node(scene, name))].mesh)];
    const auto edges = directed_edges(join(mesh));
    int boundary = 0;
    for (const auto& [edge, count] : edges) {
      EXPECT_EQ(count, 1);
      if (edges.count({edge.second, edge.first}) == 0) ++boundary;
    }
    EXPECT_GT(boundary, 0) << name;
  }
  for (const std::string name : {"eye_l", "eye_r"}) {
    const auto& eye = scene.nodes[static_cast<std::size_t>(node(scene, name))];
    EXPECT_FALSE(eye.skinned);
    EXPECT_EQ(eye.parent, node(scene, "head"));
  }
  std::set<int> weighted;
  for (const auto& mesh : scene.meshes)
    for (const auto& primitive : mesh.primitives)
      for (const auto& influences : primitive.weights)
        for (const auto& influence : influences) weighted.insert(influence.frame);
  for (const std::string name : {"root", "head_end", "foot_target_l", "foot_target_r"})
    EXPECT_EQ(weighted.count(node(scene, name)), 0u) << name;
  // The root lies behind everything.
  const double root_z = scene.nodes[static_cast<std::size_t>(node(scene, "root"))].local.translation.z();
  EXPECT_LT(root_z, scene.meshes[0].primitives[0].points.col(2).minCoeff() - 0.1);
}

TEST(ExactMath, SineAndCosineAgreeWithTheLibrary) {
  for (int i = -4000; i <= 4000; ++i) {
    const double degrees = 0.37 * i;
    const SineCosine r = sine_cosine(degrees);
    const double x = degrees * std::numbers::pi / 180.0;
    // Three doublings multiply the rounding of the series by up to 2^3 each way; the library's argument has
    // an error of its own of |x| eps, at most 26 * 1.1e-16.
    EXPECT_NEAR(r.sine, std::sin(x), 8e-15) << degrees;
    EXPECT_NEAR(r.cosine, std::cos(x), 8e-15) << degrees;
  }
}

TEST(Curve, PassesThroughItsKeysWithoutOvershootAndHoldsItsEnds) {
  const Curve curve({{0, 1}, {1, 3}, {1.5, 3}, {2, -1}});
  for (const auto& [t, value] :
       {std::pair{0.0, 1.0}, {1.0, 3.0}, {1.5, 3.0}, {2.0, -1.0}, {-1.0, 1.0}, {5.0, -1.0}})
    EXPECT_DOUBLE_EQ(curve(t), value) << t;
  for (int i = 0; i <= 200; ++i) {
    EXPECT_LE(curve(0.01 * i), 3.0 + 1e-15);
    EXPECT_GE(curve(0.01 * i), -1.0 - 1e-15);
  }
}

}  // namespace
}  // namespace sinew::samples
