#include "assets/detail/fbx_document.h"

#include <utility>

#include "assets/detail/fbx_tree.h"

namespace sinew::assets::detail {

namespace {

/// Text files write "Model::Hips", binary ones "Hips\0\1Model".
std::string plain_name(const std::string& name) {
  const std::size_t binary = name.find('\0');
  if (binary != std::string::npos) return name.substr(0, binary);
  const std::size_t text = name.find("::");
  return text == std::string::npos ? name : name.substr(text + 2);
}

/// The last value of the property of that name, from a Properties70 block.
const FbxValue* property(const FbxNode& object, const std::string& name) {
  const FbxNode* block = object.child("Properties70");
  if (block == nullptr) return nullptr;
  for (const FbxNode& p : block->children) {
    if (p.values.size() >= 5 && p.values[0].text == name) return &p.values.back();
  }
  return nullptr;
}

FbxInherit inherit_of(const FbxNode& object, FbxInherit otherwise) {
  const FbxValue* value = property(object, "InheritType");
  if (value == nullptr || value->kind != FbxValue::Kind::Number) return otherwise;
  if (value->number == 1.0) return FbxInherit::RSrs;
  if (value->number == 2.0) return FbxInherit::Rrs;
  return FbxInherit::RrSs;
}

/// What models have that say nothing: the file's template, else the format's own default.
FbxInherit default_inherit(const FbxNode& root) {
  const FbxNode* definitions = root.child("Definitions");
  if (definitions == nullptr) return FbxInherit::RrSs;
  for (const FbxNode& type : definitions->children) {
    if (type.name != "ObjectType" || type.values.empty() || type.values[0].text != "Model") continue;
    const FbxNode* pattern = type.child("PropertyTemplate");
    if (pattern != nullptr) return inherit_of(*pattern, FbxInherit::RrSs);
  }
  return FbxInherit::RrSs;
}

/// Object-to-object connections; children and parents of an id in the file's order.
struct Links {
  std::multimap<std::int64_t, std::int64_t> parents, children;
};

Links read_links(const FbxNode& root) {
  Links links;
  const FbxNode* connections = root.child("Connections");
  if (connections == nullptr) return links;
  for (const FbxNode& c : connections->children) {
    if (c.values.size() < 3 || c.values[0].text != "OO") continue;
    links.parents.emplace(c.values[1].whole, c.values[2].whole);
    links.children.emplace(c.values[2].whole, c.values[1].whole);
  }
  return links;
}

/// First object among those linked to `id` that `names` knows; empty where there is none.
std::string linked(const std::multimap<std::int64_t, std::int64_t>& links, std::int64_t id,
                   const std::map<std::int64_t, std::string>& names) {
  const auto range = links.equal_range(id);
  for (auto it = range.first; it != range.second; ++it) {
    const auto found = names.find(it->second);
    if (found != names.end()) return found->second;
  }
  return "";
}

/// Rows of 16 numbers for row vectors are columns for ours.
bool read_matrix(const FbxNode& object, std::string_view name, Eigen::Affine3d& matrix) {
  const FbxNode* node = object.child(name);
  if (node == nullptr || node->values.empty() || node->values[0].list.size() != 16) return false;
  matrix.matrix() = Eigen::Map<const Eigen::Matrix4d>(node->values[0].list.data());
  matrix.makeAffine();
  return true;
}

}  // namespace

FbxFacts read_fbx_facts(std::string_view bytes) {
  const FbxNode root = parse_fbx(bytes);
  FbxFacts facts;
  const FbxNode* objects = root.child("Objects");
  if (objects == nullptr) return facts;
  const FbxInherit otherwise = default_inherit(root);
  const Links links = read_links(root);
  std::map<std::int64_t, std::string> models;
  for (const FbxNode& object : objects->children) {
    if (object.name != "Model" || object.values.size() < 2) continue;
    const std::string name = plain_name(object.values[1].text);
    models[object.values[0].whole] = name;
    facts.inherit.emplace(name, inherit_of(object, otherwise));
  }
  // Geometry, skin: which model shows them. A skin hangs below a geometry, that below a model.
  std::map<std::int64_t, std::string> shown_by;
  for (const FbxNode& object : objects->children) {
    if (object.name == "Geometry" && !object.values.empty()) {
      shown_by[object.values[0].whole] = linked(links.parents, object.values[0].whole, models);
    }
  }
  std::map<std::int64_t, std::string> skins;
  for (const FbxNode& object : objects->children) {
    if (object.name == "Deformer" && object.values.size() >= 3 && object.values[2].text == "Skin") {
      skins[object.values[0].whole] = linked(links.parents, object.values[0].whole, shown_by);
    }
  }
  for (const FbxNode& object : objects->children) {
    if (object.name != "Deformer" || object.values.size() < 3 || object.values[2].text != "Cluster") continue;
    FbxCluster cluster;
    cluster.geometry = linked(links.parents, object.values[0].whole, skins);
    cluster.joint = linked(links.children, object.values[0].whole, models);
    if (!read_matrix(object, "Transform", cluster.joint_from_mesh)) continue;
    if (!read_matrix(object, "TransformLink", cluster.world_from_joint)) continue;
    facts.clusters.push_back(std::move(cluster));
  }
  return facts;
}

}  // namespace sinew::assets::detail
