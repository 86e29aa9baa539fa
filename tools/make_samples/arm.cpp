#include "tools/make_samples/motion.h"
#include "tools/make_samples/samples.h"
#include "tools/make_samples/skin_mesh.h"

namespace sinew::samples {
namespace {

using Eigen::Vector3d;

const Vector3d kShoulder(0, 0.585, 0), kElbow(0, 0.325, -0.004), kWrist(0, 0.105, 0),
    kFingers(0, 0.012, 0.004);

/// Hanging arm, biceps to the front (+z), thumb forward.
Solid arm_solid() {
  Solid arm = tapered_capsule(kShoulder, kElbow, 0.049, 0.036);
  arm = blended(arm, ellipsoid({0, 0.598, 0.002}, {0.058, 0.064, 0.060}), 0.05);      // deltoid
  arm = blended(arm, ellipsoid({0, 0.455, 0.023}, {0.036, 0.088, 0.036}, -3), 0.03);  // biceps
  arm = blended(arm, ellipsoid({0, 0.475, -0.022}, {0.037, 0.098, 0.033}, 2), 0.03);  // triceps
  arm = blended(arm, ellipsoid({0, 0.330, -0.014}, {0.028, 0.030, 0.027}), 0.03);     // elbow
  Solid forearm = tapered_capsule(kElbow, kWrist, 0.037, 0.0235);
  forearm = blended(forearm, ellipsoid({0, 0.248, 0.004}, {0.043, 0.082, 0.040}, 1), 0.03);
  arm = blended(arm, forearm, 0.025);
  Solid hand = ellipsoid({0, 0.066, 0.002}, {0.021, 0.046, 0.037});                 // palm
  hand = blended(hand, ellipsoid({0, 0.034, 0.004}, {0.017, 0.036, 0.033}), 0.02);  // fingers
  hand = blended(hand, tapered_capsule({0, 0.078, 0.030}, {0, 0.040, 0.052}, 0.015, 0.0115), 0.014);  // thumb
  return blended(arm, hand, 0.025);
}

Motion elbow_motion() {
  const Curve bend({{0.0, 0.0}, {0.1, 0.0}, {0.9, -120.0}});
  return [=](double t, std::vector<JointPose>& pose) { pose[1].degrees.x() = bend(t); };
}

Motion twist_motion() {
  const Curve twist({{0.0, 0.0}, {0.1, 0.0}, {0.7, 90.0}});
  return [=](double t, std::vector<JointPose>& pose) { pose[1].degrees.y() = twist(t); };
}

}  // namespace

assets::GlbScene make_arm() {
  const std::vector<SampleJoint> joints = {
      {"upper_arm", "", kShoulder}, {"forearm", "upper_arm", kElbow}, {"forearm_end", "forearm", kFingers}};
  const SkinMesh mesh =
      polygonise(arm_solid(), {.low = {-0.08, -0.03, -0.09}, .high = {0.08, 0.69, 0.09}, .spacing = 0.0105});
  const std::vector<WeightBone> bones = {{0, kShoulder + Vector3d(0, 0.03, 0), kElbow, 0.055, 0.038},
                                         {1, kElbow, kWrist, 0.038, 0.024},
                                         {1, kWrist, kFingers, 0.024, 0.02}};
  assets::GlbScene scene;
  scene.materials = {{"skin", {0.80, 0.47, 0.34}, 0.6, false}};
  add_skeleton(joints, scene);
  scene.meshes = {{"arm",
                   {{mesh.points,
                     vertex_normals(mesh.points, mesh.triangles),
                     mesh.triangles,
                     0,
                     {},
                     heat_weights(mesh, bones, mirror_joints(joints))}}}};
  scene.nodes.push_back({.name = "arm", .mesh = 0, .skinned = true});
  scene.clips = {make_clip("elbow", 2.4, joints, elbow_motion()),
                 make_clip("twist", 2.0, joints, twist_motion())};
  return scene;
}

}  // namespace sinew::samples
