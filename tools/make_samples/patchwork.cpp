#include <cmath>

#include "tools/make_samples/exact_math.h"
#include "tools/make_samples/motion.h"
#include "tools/make_samples/samples.h"
#include "tools/make_samples/skin_mesh.h"

namespace sinew::samples {
namespace {

using Eigen::Vector3d;

// Rest places of the joints [m]: y up, looking along +z, soles on y = 0; the left side is +x.
const Vector3d kRoot(0, 0, -0.60), kHips(0, 0.345, 0), kSpine(0, 0.45, 0), kChest(0, 0.555, -0.005),
    kHead(0, 0.665, 0), kCrown(0, 1.00, 0);
const Vector3d kUpperArm(0.115, 0.585, 0), kForearm(0.225, 0.510, 0.005), kHand(0.335, 0.430, 0.015);
const Vector3d kThigh(0.082, 0.320, 0), kShin(0.112, 0.190, 0.008), kFoot(0.125, 0.055, 0),
    kToe(0.135, 0.038, 0.105);
const Vector3d kEye(0.060, 0.835, 0.128), kButton(0, 0.770, 0.178);

std::vector<SampleJoint> joints() {
  std::vector<SampleJoint> list = {{"root", "", kRoot},       {"hips", "root", kHips},
                                   {"spine", "hips", kSpine}, {"chest", "spine", kChest},
                                   {"head", "chest", kHead},  {"head_end", "head", kCrown}};
  for (const auto& [side, sign] : {std::pair<std::string, double>{"_l", 1.0}, {"_r", -1.0}}) {
    const auto add = [&, s = sign, suffix = side](const char* name, const std::string& parent,
                                                  const Vector3d& p) {
      list.push_back({name + suffix, parent, Vector3d(s * p.x(), p.y(), p.z())});
    };
    add("upper_arm", "chest", kUpperArm);
    add("forearm", "upper_arm" + side, kForearm);
    add("thigh", "hips", kThigh);
    add("shin", "thigh" + side, kShin);
    add("foot", "shin" + side, kFoot);
    add("foot_target", "root", kFoot);  // a handle for animators, without weight
  }
  return list;
}

Solid body_solid() {
  Solid body = ellipsoid({0, 0.375, 0.005}, {0.128, 0.120, 0.110});
  body = blended(body, ellipsoid({0, 0.515, 0}, {0.108, 0.120, 0.090}), 0.08);
  Solid arm = tapered_capsule(kUpperArm, kForearm, 0.046, 0.042);
  arm = blended(arm, tapered_capsule(kForearm, kHand, 0.042, 0.050), 0.02);
  body = blended(body, mirrored(arm), 0.035);
  Solid leg = tapered_capsule(kThigh, kShin, 0.068, 0.056);
  leg = blended(leg, tapered_capsule(kShin, kFoot, 0.056, 0.052), 0.02);
  leg = blended(leg, ellipsoid({0.132, 0.048, 0.045}, {0.056, 0.048, 0.088}), 0.03);
  body = blended(body, mirrored(leg), 0.022);
  Solid head = ellipsoid({0, 0.790, 0.0}, {0.160, 0.140, 0.142});
  head = blended(head, ellipsoid({0, 0.755, 0.122}, {0.070, 0.052, 0.058}), 0.03);  // snout
  head = blended(head,
                 mirrored(carved(ellipsoid({0.128, 0.905, -0.005}, {0.058, 0.058, 0.040}),
                                 ellipsoid({0.130, 0.905, 0.036}, {0.034, 0.034, 0.016}), 0.025)),
                 0.02);
  return blended(body, head, 0.045);
}

std::vector<WeightBone> weight_bones(const std::vector<SampleJoint>& list) {
  std::vector<WeightBone> bones;
  const auto add = [&](const std::string& joint, const Vector3d& a, const Vector3d& b, double ra, double rb) {
    bones.push_back({joint_index(list, joint), a, b, ra, rb});
  };
  add("hips", kHips - Vector3d(0, 0.04, 0), kSpine, 0.115, 0.11);
  add("spine", kSpine, kChest, 0.11, 0.10);
  add("chest", kChest, kHead, 0.10, 0.06);
  add("head", kHead + Vector3d(0, 0.06, 0), {0, 0.84, 0}, 0.10, 0.13);
  for (const auto& [side, sign] : {std::pair<std::string, double>{"_l", 1.0}, {"_r", -1.0}}) {
    const auto limb = [&, s = sign, suffix = side](const char* joint, const Vector3d& a, const Vector3d& b,
                                                   double ra, double rb) {
      add(joint + suffix, {s * a.x(), a.y(), a.z()}, {s * b.x(), b.y(), b.z()}, ra, rb);
    };
    limb("upper_arm", kUpperArm, kForearm, 0.046, 0.042);
    limb("forearm", kForearm, kHand, 0.042, 0.050);
    limb("thigh", kThigh, kShin, 0.068, 0.056);
    limb("shin", kShin, kFoot, 0.056, 0.052);
    limb("foot", kFoot, kToe, 0.052, 0.04);
  }
  return bones;
}

// --- patches: one mesh of several materials, cut along triangle edges ---

enum Material { kTan, kRed, kBlue, kCream, kSkirt, kCape, kGlass, kNose, kNumMaterials };

int patch_of(const Vector3d& p) {
  if (p.y() > 0.665) return p.z() > 0.118 && p.y() < 0.80 ? kCream : kTan;
  if (std::abs(p.x()) > 0.245) return kCream;                    // mittens
  if (p.y() < 0.095) return kCream;                              // feet
  if (std::abs(p.x()) > 0.135) return p.x() > 0 ? kRed : kBlue;  // sleeves
  if (p.y() < 0.27) return p.x() > 0 ? kBlue : kRed;             // legs
  return p.z() > 0.04 && std::abs(p.x()) < 0.075 && p.y() < 0.60 ? kCream : (p.x() > 0 ? kBlue : kRed);
}

using Weights = std::vector<std::vector<lattice::Influence>>;

/// The triangles of one patch with their own copies of the vertices on its seams.
assets::GlbPrimitive cut_patch(const SkinMesh& mesh, const lattice::Points& normals, const Weights& weights,
                               int patch) {
  std::vector<int> local(static_cast<std::size_t>(mesh.points.rows()), -1), used;
  std::vector<Eigen::RowVector3i> triangles;
  for (Eigen::Index t = 0; t < mesh.triangles.rows(); ++t) {
    Vector3d centre = Vector3d::Zero();
    for (int c = 0; c < 3; ++c) centre += mesh.points.row(mesh.triangles(t, c)).transpose() / 3.0;
    if (patch_of(to_grid(centre)) != patch) continue;
    Eigen::RowVector3i triangle;
    for (int c = 0; c < 3; ++c) {
      int& v = local[static_cast<std::size_t>(mesh.triangles(t, c))];
      if (v < 0) {
        v = static_cast<int>(used.size());
        used.push_back(mesh.triangles(t, c));
      }
      triangle[c] = v;
    }
    triangles.push_back(triangle);
  }
  assets::GlbPrimitive primitive;
  primitive.material = patch;
  primitive.points = mesh.points(used, Eigen::all);
  primitive.normals = normals(used, Eigen::all);
  for (const int v : used) primitive.weights.push_back(weights[static_cast<std::size_t>(v)]);
  primitive.triangles.resize(static_cast<Eigen::Index>(triangles.size()), 3);
  for (std::size_t t = 0; t < triangles.size(); ++t)
    primitive.triangles.row(static_cast<Eigen::Index>(t)) = triangles[t];
  return primitive;
}

// --- cloth: open sheets over the body ---

/// A sheet of `rows` by `columns` points; a closed one joins its last column to its first.
struct Sheet {
  int rows, columns;
  bool closed;
  std::function<Vector3d(double row, double column)> at;  ///< both in [0, 1].
};

/// Mean of the body's weights near p, nearest vertices counting most.
std::vector<lattice::Influence> weights_near(const SkinMesh& body, const Weights& weights, const Vector3d& p,
                                             double reach, std::size_t num_joints) {
  std::vector<double> sum(num_joints, 0.0);
  const double nearest_squared = (body.points.rowwise() - p.transpose()).rowwise().squaredNorm().minCoeff();
  const double radius_squared = nearest_squared + reach * reach;
  for (Eigen::Index v = 0; v < body.points.rows(); ++v) {
    const double distance_squared = (body.points.row(v).transpose() - p).squaredNorm();
    if (distance_squared >= radius_squared) continue;
    const double share = 1.0 - distance_squared / radius_squared;
    for (const auto& influence : weights[static_cast<std::size_t>(v)])
      sum[static_cast<std::size_t>(influence.frame)] += share * share * influence.weight;
  }
  std::vector<lattice::Influence> result;
  for (std::size_t j = 0; j < num_joints; ++j)
    if (sum[j] > 0.0) result.push_back({static_cast<int>(j), sum[j]});
  std::stable_sort(result.begin(), result.end(),
                   [](const auto& a, const auto& b) { return a.weight > b.weight; });
  if (result.size() > 4) result.resize(4);
  double total = 0.0;
  for (const auto& influence : result) total += influence.weight;
  for (auto& influence : result) influence.weight = to_grid(influence.weight / total);
  return result;
}

assets::GlbPrimitive make_sheet(const Sheet& sheet, int material) {
  assets::GlbPrimitive primitive;
  primitive.material = material;
  primitive.points.resize(sheet.rows * sheet.columns, 3);
  const int spans = sheet.closed ? sheet.columns : sheet.columns - 1;
  for (int r = 0; r < sheet.rows; ++r)
    for (int c = 0; c < sheet.columns; ++c)
      primitive.points.row(r * sheet.columns + c) =
          to_grid(sheet.at(double(r) / (sheet.rows - 1), double(c) / spans)).transpose();
  primitive.triangles.resize(2 * (sheet.rows - 1) * spans, 3);
  Eigen::Index t = 0;
  for (int r = 0; r + 1 < sheet.rows; ++r) {
    for (int c = 0; c < spans; ++c) {
      const int next = (c + 1) % sheet.columns;
      const int a = r * sheet.columns + c, b = r * sheet.columns + next, d = a + sheet.columns,
                e = b + sheet.columns;
      primitive.triangles.row(t++) << a, d, e;
      primitive.triangles.row(t++) << a, e, b;
    }
  }
  primitive.normals = vertex_normals(primitive.points, primitive.triangles);
  return primitive;
}

/// From the waist down, flaring into folds. Columns run counter-clockwise seen from above.
Sheet skirt() {
  return {9, 48, true, [](double row, double column) {
            const SineCosine around = sine_cosine(360.0 * column);
            const double fold = sine_cosine(8.0 * 360.0 * column).cosine;
            const double radius_x = 0.132 + 0.082 * row + 0.010 * row * fold;
            const double radius_z = 0.112 + 0.084 * row + 0.010 * row * fold;
            return Vector3d(radius_x * around.sine, 0.445 - 0.195 * row * (1.0 - 0.12 * row),
                            radius_z * around.cosine);
          }};
}

/// Hanging from the shoulders down the back, with folds.
Sheet cape() {
  return {15, 19, false, [](double row, double column) {
            const double across = 2.0 * column - 1.0;  // -1 at the right edge (x < 0) ... 1
            const double fold = sine_cosine(3.0 * 360.0 * column).cosine;
            const double width = 0.100 + 0.085 * row;
            return Vector3d(-width * across, 0.640 - 0.375 * row,
                            -0.070 - 0.115 * row + 0.030 * row * row +
                                0.055 * across * across * (1.0 - 0.6 * row) - 0.010 * row * fold);
          }};
}

/// Ellipsoid of rings and sectors about the origin, for a rigid part.
assets::GlbPrimitive ball(const Vector3d& radii, int material) {
  constexpr int kRings = 10, kSectors = 16;
  assets::GlbPrimitive primitive;
  primitive.material = material;
  primitive.points.resize(2 + (kRings - 1) * kSectors, 3);
  std::vector<Eigen::RowVector3i> triangles;
  const auto vertex = [](int ring, int sector) { return 1 + (ring - 1) * kSectors + sector % kSectors; };
  const int last = 1 + (kRings - 1) * kSectors;
  primitive.points.row(0) << 0, 0, radii.z();
  primitive.points.row(last) << 0, 0, -radii.z();
  for (int r = 1; r < kRings; ++r) {
    const SineCosine polar = sine_cosine(180.0 * r / kRings);
    for (int s = 0; s < kSectors; ++s) {
      const SineCosine around = sine_cosine(360.0 * s / kSectors);
      primitive.points.row(vertex(r, s)) =
          to_grid(radii.cwiseProduct(
                      Vector3d(polar.sine * around.cosine, polar.sine * around.sine, polar.cosine)))
              .transpose();
    }
  }
  for (int s = 0; s < kSectors; ++s) {
    triangles.push_back({0, vertex(1, s), vertex(1, s + 1)});
    for (int r = 1; r + 1 < kRings; ++r) {
      triangles.push_back({vertex(r, s), vertex(r + 1, s), vertex(r + 1, s + 1)});
      triangles.push_back({vertex(r, s), vertex(r + 1, s + 1), vertex(r, s + 1)});
    }
    triangles.push_back({vertex(kRings - 1, s), last, vertex(kRings - 1, s + 1)});
  }
  primitive.triangles.resize(static_cast<Eigen::Index>(triangles.size()), 3);
  for (std::size_t t = 0; t < triangles.size(); ++t)
    primitive.triangles.row(static_cast<Eigen::Index>(t)) = triangles[t];
  primitive.normals = vertex_normals(primitive.points, primitive.triangles);
  return primitive;
}

void dance(const std::vector<SampleJoint>& list, double t, std::vector<JointPose>& pose) {
  const auto joint = [&](const std::string& name) -> JointPose& {
    return pose[static_cast<std::size_t>(joint_index(list, name))];
  };
  static const Curve twist({{0, 0}, {0.35, 38}, {0.85, -38}, {1.35, 38}, {1.75, -30}, {2.15, 0}});
  static const Curve sway({{0, 0}, {0.35, 10}, {0.85, -10}, {1.35, 10}, {1.75, -8}, {2.15, 0}});
  static const Curve bounce({{0, 0},
                             {0.17, -0.022},
                             {0.35, 0},
                             {0.60, -0.022},
                             {0.85, 0},
                             {1.10, -0.022},
                             {1.35, 0},
                             {1.55, -0.022},
                             {1.75, 0},
                             {1.95, -0.015},
                             {2.15, 0}});
  joint("hips").offset = {0.003 * sway(t), bounce(t), 0};
  joint("hips").degrees = {0, 0.55 * twist(t), 0.35 * sway(t)};
  joint("spine").degrees = {0, -0.4 * twist(t), -0.6 * sway(t)};
  joint("chest").degrees = {0, -0.5 * twist(t), -0.6 * sway(t)};
  joint("head").degrees = {4.0, 0.45 * twist(t - 0.05), 0.9 * sway(t - 0.05)};
  static const Curve lift({{0, 0}, {0.35, 42}, {0.85, 6}, {1.35, 42}, {1.75, 10}, {2.15, 0}});
  static const Curve lift_other({{0, 0}, {0.35, 6}, {0.85, 42}, {1.35, 6}, {1.75, 34}, {2.15, 0}});
  joint("upper_arm_l").degrees = {0, 0, lift(t)};
  joint("forearm_l").degrees = {0, 0, 0.9 * lift(t - 0.05)};
  joint("upper_arm_r").degrees = {0, 0, -lift_other(t)};
  joint("forearm_r").degrees = {0, 0, -0.9 * lift_other(t - 0.05)};
  for (const std::string side : {"_l", "_r"}) {
    // The legs stay under the swinging hips; knees take the bounce.
    joint("thigh" + side).degrees = {900.0 * bounce(t), -0.35 * twist(t), -0.45 * sway(t)};
    joint("shin" + side).degrees = {-1800.0 * bounce(t), -0.2 * twist(t), 0.1 * sway(t)};
    joint("foot" + side).degrees = {900.0 * bounce(t), 0, 0};
  }
}

}  // namespace

assets::GlbScene make_patchwork() {
  const std::vector<SampleJoint> list = joints();
  const SkinMesh body =
      polygonise(body_solid(), {.low = {-0.42, -0.03, -0.19}, .high = {0.42, 1.0, 0.22}, .spacing = 0.0160});
  const lattice::Points normals = vertex_normals(body.points, body.triangles);
  const Weights weights = heat_weights(body, weight_bones(list), mirror_joints(list));
  assets::GlbScene scene;
  scene.materials = {
      {"tan felt", {0.74, 0.52, 0.32}, 0.9, false},   {"red check", {0.70, 0.16, 0.14}, 0.9, false},
      {"blue denim", {0.16, 0.28, 0.52}, 0.9, false}, {"cream wool", {0.90, 0.83, 0.68}, 0.9, false},
      {"skirt", {0.86, 0.58, 0.18}, 0.9, true},       {"cape", {0.18, 0.46, 0.36}, 0.9, true},
      {"glass", {0.03, 0.03, 0.04}, 0.15, false},     {"nose", {0.10, 0.06, 0.05}, 0.4, false}};
  add_skeleton(list, scene);
  assets::GlbMesh patches{"body", {}};
  for (const int patch : {kTan, kRed, kBlue, kCream})
    patches.primitives.push_back(cut_patch(body, normals, weights, patch));
  scene.meshes.push_back(patches);
  scene.nodes.push_back({.name = "body", .mesh = 0, .skinned = true});
  const auto add_cloth = [&](const char* name, const Sheet& sheet, int material, double reach) {
    assets::GlbPrimitive cloth = make_sheet(sheet, material);
    for (Eigen::Index v = 0; v < cloth.points.rows(); ++v)
      cloth.weights.push_back(
          weights_near(body, weights, cloth.points.row(v).transpose(), reach, list.size()));
    scene.meshes.push_back({name, {cloth}});
    scene.nodes.push_back({.name = name, .mesh = static_cast<int>(scene.meshes.size()) - 1, .skinned = true});
  };
  add_cloth("skirt", skirt(), kSkirt, 0.10);
  add_cloth("cape", cape(), kCape, 0.10);
  const auto add_rigid = [&](const char* name, const char* joint, int mesh, const Vector3d& place) {
    assets::GlbNode node;
    node.name = name;
    node.parent = joint_index(list, joint);
    node.mesh = mesh;
    node.local.translation = to_grid(Vector3d(place - list[static_cast<std::size_t>(node.parent)].position));
    scene.nodes.push_back(node);
  };
  scene.meshes.push_back({"eye", {ball({0.021, 0.026, 0.014}, kGlass)}});
  scene.meshes.push_back({"nose", {ball({0.022, 0.016, 0.014}, kNose)}});
  add_rigid("eye_l", "head", 3, kEye);
  add_rigid("eye_r", "head", 3, {-kEye.x(), kEye.y(), kEye.z()});
  add_rigid("nose", "head", 4, kButton);
  scene.clips = {
      make_clip("dance", 2.4, list, [&](double t, std::vector<JointPose>& pose) { dance(list, t, pose); })};
  return scene;
}

}  // namespace sinew::samples
