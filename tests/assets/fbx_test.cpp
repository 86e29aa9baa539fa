#include <cmath>
#include <cstdint>
#include <cstring>
#include <numbers>
#include <stdexcept>
#include <string>

#include <gtest/gtest.h>
#include <zlib.h>

#include "assets/detail/fbx_document.h"
#include "assets/detail/fbx_inheritance.h"
#include "assets/detail/fbx_tree.h"
#include "skeleton/clip.h"
#include "skeleton/skeleton.h"

namespace sinew::assets::detail {
namespace {

constexpr const char* kText = R"(; FBX 7.5.0 project file
FBXHeaderExtension:  {
	FBXVersion: 7500
	Creator: "a; b { c"
}
Definitions:  {
	ObjectType: "Model" {
		PropertyTemplate: "FbxNode" {
			Properties70:  {
				P: "InheritType", "enum", "", "",0
			}
		}
	}
}
Objects:  {
	Geometry: 10, "Geometry::", "Mesh" {
		Vertices: *18 {
			a: 0,0,0,1,0,0,0,1,0,0,0,1,
2,2,2,3,3,3
		}
	}
	Model: 20, "Model::Body", "Mesh" {
		Properties70:  {
			P: "InheritType", "enum", "", "",1
		}
		Shading: W
	}
	Model: 30, "Model::Hip", "LimbNode" {
		Properties70:  {
			P: "InheritType", "enum", "", "",2
		}
	}
	Model: 40, "Model::Quiet", "LimbNode" {
	}
	Deformer: 50, "Deformer::", "Skin" {
	}
	Deformer: 60, "SubDeformer::", "Cluster" {
		Transform: *16 {
			a: 1,0,0,0,0,1,0,0,0,0,1,0,5,6,7,1
		}
		TransformLink: *16 {
			a: 0,1,0,0,-1,0,0,0,0,0,1,0,1,2,3,1
		}
	}
}
Connections:  {
	C: "OO",10,20
	C: "OO",50,10
	C: "OO",60,50
	C: "OO",30,60
	C: "OP",30,60, "Lcl Scaling"
}
)";

void expect_facts(const FbxFacts& facts) {
  ASSERT_EQ(facts.inherit.size(), 3u);
  EXPECT_EQ(facts.inherit.at("Body"), FbxInherit::RSrs);
  EXPECT_EQ(facts.inherit.at("Hip"), FbxInherit::Rrs);
  EXPECT_EQ(facts.inherit.at("Quiet"), FbxInherit::RrSs) << "the template's";
  ASSERT_EQ(facts.clusters.size(), 1u);
  EXPECT_EQ(facts.clusters[0].geometry, "Body");
  EXPECT_EQ(facts.clusters[0].joint, "Hip");
  EXPECT_EQ(facts.clusters[0].joint_from_mesh.translation(), Eigen::Vector3d(5, 6, 7));
  // Row vectors: the first row (0, 1, 0) is where x goes.
  EXPECT_EQ(facts.clusters[0].world_from_joint * Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(1, 3, 3));
}

TEST(FbxFacts, AreReadFromText) { expect_facts(read_fbx_facts(kText)); }

/// Writes a parsed tree as binary FBX, with 32- or 64-bit offsets.
class BinaryWriter {
 public:
  explicit BinaryWriter(std::uint32_t version, bool compress) : version_(version), compress_(compress) {
    bytes_ = std::string("Kaydara FBX Binary  \0\x1a\0", 23);
    put(version);
  }

  std::string write(const FbxNode& root) {
    for (const FbxNode& node : root.children) write_node(node);
    bytes_.append(version_ >= 7500 ? 25 : 13, '\0');
    return bytes_;
  }

 private:
  template <typename T>
  void put(T value) {
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof(T));
  }
  void put_size(std::uint64_t value) {
    version_ >= 7500 ? put(value) : put(static_cast<std::uint32_t>(value));
  }
  void write_node(const FbxNode& node) {
    const std::size_t start = bytes_.size();
    put_size(0);
    put_size(node.values.size());
    put_size(0);
    put(static_cast<std::uint8_t>(node.name.size()));
    bytes_ += node.name;
    for (const FbxValue& value : node.values) write_value(value);
    for (const FbxNode& child : node.children) write_node(child);
    if (!node.children.empty()) bytes_.append(version_ >= 7500 ? 25 : 13, '\0');
    const std::uint64_t end = bytes_.size();
    const auto end32 = static_cast<std::uint32_t>(end);
    version_ >= 7500 ? std::memcpy(bytes_.data() + start, &end, 8)
                     : std::memcpy(bytes_.data() + start, &end32, 4);
  }
  void write_value(const FbxValue& value) {
    if (value.kind == FbxValue::Kind::Number) {
      bytes_.push_back('L');
      put(value.whole);
    } else if (value.kind == FbxValue::Kind::Text) {
      bytes_.push_back('S');
      // "Model::Hip" is stored as "Hip", zero, one, "Model".
      std::string text = value.text;
      const std::size_t colons = text.find("::");
      if (colons != std::string::npos) {
        text = text.substr(colons + 2) + std::string("\0\1", 2) + text.substr(0, colons);
      }
      put(static_cast<std::uint32_t>(text.size()));
      bytes_ += text;
    } else {
      bytes_.push_back('d');
      put(static_cast<std::uint32_t>(value.list.size()));
      put(static_cast<std::uint32_t>(compress_ ? 1 : 0));
      std::string data(reinterpret_cast<const char*>(value.list.data()), value.list.size() * sizeof(double));
      if (compress_) {
        std::string packed(::compressBound(data.size()), '\0');
        uLongf size = packed.size();
        ::compress(reinterpret_cast<Bytef*>(packed.data()), &size,
                   reinterpret_cast<const Bytef*>(data.data()), data.size());
        data = packed.substr(0, size);
      }
      put(static_cast<std::uint32_t>(data.size()));
      bytes_ += data;
    }
  }

  std::uint32_t version_;
  bool compress_;
  std::string bytes_;
};

TEST(FbxFacts, AreReadFromBinaryOfBothWidths) {
  for (const std::uint32_t version : {7400u, 7500u}) {
    for (const bool compress : {false, true}) {
      SCOPED_TRACE(version);
      expect_facts(read_fbx_facts(BinaryWriter(version, compress).write(parse_fbx(kText))));
    }
  }
}

TEST(FbxTree, CutAtAnyByteEndsOrThrows) {
  const std::string binary = BinaryWriter(7500, true).write(parse_fbx(kText));
  const std::string text = kText;
  for (const std::string& whole : {binary, text}) {
    for (std::size_t length = 0; length < whole.size(); ++length) {
      try {
        read_fbx_facts(std::string_view(whole).substr(0, length));
      } catch (const std::runtime_error& e) {
        EXPECT_STRNE(e.what(), "");
      }
    }
  }
}

TEST(FbxTree, RefusesBracesWithoutEnd) {
  std::string deep = "Objects: ";
  for (int i = 0; i < 100000; ++i) deep += "{ a: ";
  EXPECT_THROW(parse_fbx(deep), std::runtime_error);
}

/// Three nodes a unit apart along x, each turned a quarter about z; the first two scaled unevenly.
ImportedScene chain() {
  ImportedScene scene;
  for (int n = 0; n < 3; ++n) {
    ImportedNode node;
    node.name = std::string(1, static_cast<char>('a' + n));
    node.parent = n - 1;
    node.local.translation << 1, 0, 0;
    node.local.rotation = Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitZ());
    if (n == 0) node.local.scale << 2, 3, 4;
    if (n == 1) node.local.scale << 5, 6, 7;
    node.parent_from_node = node.local.matrix();
    scene.nodes.push_back(node);
  }
  return scene;
}

/// World linear parts and positions by FBX's own formulas, not by matrix products along the tree.
Eigen::Affine3d expected_world(FbxInherit mode, const std::vector<ImportedNode>& nodes,
                               const std::vector<Eigen::Vector3d>& scales, int n) {
  Eigen::Affine3d world = Eigen::Affine3d::Identity();
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d gathered = Eigen::Vector3d::Ones();
  for (int i = 0; i <= n; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const Eigen::Vector3d origin = world * nodes[k].local.translation;
    rotation = rotation * nodes[k].local.rotation.toRotationMatrix();
    if (mode == FbxInherit::RrSs) {
      gathered = gathered.cwiseProduct(scales[k]);
      world.linear() = rotation * gathered.asDiagonal();
    } else {
      // Rrs: of the parent's frame all but its own scale is inherited.
      Eigen::Matrix3d parent = world.linear();
      if (i > 0) parent = parent * scales[k - 1].cwiseInverse().asDiagonal();
      world.linear() = parent * nodes[k].local.rotation.toRotationMatrix() * scales[k].asDiagonal();
    }
    world.translation() = origin;
  }
  return world;
}

Eigen::Affine3d world_of(const ImportedScene& scene, const std::string& name, const skeleton::Clip* clip,
                         double time) {
  std::vector<skeleton::Joint> joints;
  int wanted = -1;
  for (const ImportedNode& node : scene.nodes) {
    skeleton::Joint joint;
    joint.name = node.name;
    joint.parent = node.parent;
    joint.local = node.local;
    joint.parent_from_joint = node.parent_from_node;
    if (node.name == name) wanted = static_cast<int>(joints.size());
    joints.push_back(joint);
  }
  const skeleton::Skeleton skeleton(joints);
  const skeleton::Pose pose = clip != nullptr ? sample(skeleton, *clip, time) : node_pose(skeleton);
  return pose.world_from_joint[static_cast<std::size_t>(wanted)];
}

TEST(FbxInheritance, FollowsItsFormulasWhereScalesAreUneven) {
  for (const FbxInherit mode : {FbxInherit::Rrs, FbxInherit::RrSs}) {
    const ImportedScene before = chain();
    ImportedScene scene = before;
    apply_fbx_inheritance({{"a", mode}, {"b", mode}, {"c", mode}}, scene);
    const std::vector<Eigen::Vector3d> scales{{2, 3, 4}, {5, 6, 7}, {1, 1, 1}};
    for (int n = 0; n < 3; ++n) {
      const Eigen::Affine3d expected = expected_world(mode, before.nodes, scales, n);
      const Eigen::Affine3d got =
          world_of(scene, before.nodes[static_cast<std::size_t>(n)].name, nullptr, 0.0);
      // A few products of numbers up to 100.
      EXPECT_LT((got.matrix() - expected.matrix()).norm(), 1e-12) << "node " << n;
    }
  }
}

TEST(FbxInheritance, FollowsItsFormulasAtKeysAndAlmostBetweenThem) {
  for (const FbxInherit mode : {FbxInherit::Rrs, FbxInherit::RrSs}) {
    const ImportedScene before = chain();
    ImportedScene scene = before;
    skeleton::Clip clip;
    skeleton::Channel channel;
    channel.joint = 1;
    channel.scale = {skeleton::Interpolation::Linear, {0, 1}, {{5, 6, 7}, {10, 6, 3.5}}, {}, {}};
    clip.channels.push_back(channel);
    scene.clips.push_back(clip);
    apply_fbx_inheritance({{"a", mode}, {"b", mode}, {"c", mode}}, scene);
    for (const double t : {0.0, 0.3, 1.0}) {
      const Eigen::Vector3d scale = (1 - t) * Eigen::Vector3d(5, 6, 7) + t * Eigen::Vector3d(10, 6, 3.5);
      const Eigen::Affine3d expected = expected_world(mode, before.nodes, {{2, 3, 4}, scale, {1, 1, 1}}, 2);
      const Eigen::Affine3d got = world_of(scene, "c", &scene.clips[0], t);
      // Exact at keys; between samples a chord of 1/s over a sixteenth of a doubling is off by
      // (1/16)^2 / 8 * 2 < 1e-3 of the scale.
      const double tolerance = t == 0.3 ? 1e-3 * expected.linear().norm() : 1e-12;
      EXPECT_LT((got.matrix() - expected.matrix()).norm(), tolerance) << t;
    }
  }
}

TEST(FbxInheritance, LeavesAloneWhereItMakesNoDifference) {
  ImportedScene scene = chain();
  apply_fbx_inheritance({{"a", FbxInherit::Rrs}, {"b", FbxInherit::RSrs}, {"c", FbxInherit::RSrs}}, scene);
  EXPECT_EQ(scene.nodes.size(), 3u);
  ImportedScene uniform = chain();
  for (ImportedNode& node : uniform.nodes) node.local.scale.setConstant(100.0);
  apply_fbx_inheritance({{"a", FbxInherit::RrSs}, {"b", FbxInherit::RrSs}, {"c", FbxInherit::RrSs}}, uniform);
  EXPECT_EQ(uniform.nodes.size(), 3u) << "a uniform scale commutes with rotations";
}

}  // namespace
}  // namespace sinew::assets::detail
