#include <cmath>

#include "tools/make_samples/exact_math.h"
#include "tools/make_samples/motion.h"
#include "tools/make_samples/samples.h"
#include "tools/make_samples/skin_mesh.h"

namespace sinew::samples {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// Rest places of the joints [m]: y up, looking along +z, soles on y = 0; the left side is +x.
const Vector3d kHips(0, 0.50, -0.06), kSpine(0, 0.64, -0.045), kChest(0, 0.80, 0.00), kNeck(0, 0.925, 0.045),
    kHead(0, 1.02, 0.085), kEar1(0.058, 1.145, 0.055), kEar2(0.098, 1.275, 0.025),
    kEarTip(0.140, 1.415, -0.005);
const Vector3d kUpperArm(0.132, 0.838, 0.025), kForearm(0.236, 0.742, 0.035), kHand(0.272, 0.668, 0.140),
    kFingers(0.280, 0.645, 0.210);
const Vector3d kThigh(0.125, 0.475, -0.03), kShin(0.195, 0.345, 0.155), kFoot(0.205, 0.095, -0.035),
    kToe(0.215, 0.042, 0.175), kToeTip(0.220, 0.036, 0.285);
const std::array<Vector3d, 7> kTail = {Vector3d(0, 0.45, -0.20),   Vector3d(0, 0.365, -0.335),
                                       Vector3d(0, 0.27, -0.455),  Vector3d(0, 0.185, -0.585),
                                       Vector3d(0, 0.125, -0.725), Vector3d(0, 0.095, -0.87),
                                       Vector3d(0, 0.095, -1.00)};
const std::array<double, 7> kTailRadius = {0.125, 0.102, 0.084, 0.069, 0.056, 0.045, 0.035};

std::string tail_name(std::size_t number) { return std::string("tail_").append(std::to_string(number)); }

std::vector<SampleJoint> joints() {
  std::vector<SampleJoint> list = {{"root", "", Vector3d::Zero()}, {"hips", "root", kHips},
                                   {"spine", "hips", kSpine},      {"chest", "spine", kChest},
                                   {"neck", "chest", kNeck},       {"head", "neck", kHead}};
  for (std::size_t i = 0; i + 1 < kTail.size(); ++i)
    list.push_back({tail_name(i + 1), i == 0 ? "hips" : tail_name(i), kTail[i]});
  for (const auto& [side, sign] : {std::pair<std::string, double>{"_l", 1.0}, {"_r", -1.0}}) {
    const auto add = [&, s = sign, suffix = side](const char* name, const std::string& parent,
                                                  const Vector3d& p) {
      list.push_back({name + suffix, parent, Vector3d(s * p.x(), p.y(), p.z())});
    };
    add("ear_1", "head", kEar1);
    add("ear_2", "ear_1" + side, kEar2);
    add("upper_arm", "chest", kUpperArm);
    add("forearm", "upper_arm" + side, kForearm);
    add("hand", "forearm" + side, kHand);
    add("thigh", "hips", kThigh);
    add("shin", "thigh" + side, kShin);
    add("foot", "shin" + side, kFoot);
    add("toe", "foot" + side, kToe);
  }
  return list;
}

Solid leg_solid() {
  Solid leg = tapered_capsule(kThigh, kShin, 0.125, 0.070);
  leg = blended(leg, ellipsoid({0.150, 0.425, 0.035}, {0.085, 0.135, 0.145}, 25), 0.05);
  leg = blended(leg, tapered_capsule(kShin, kFoot, 0.066, 0.038), 0.04);
  leg = blended(leg, ellipsoid({0.198, 0.265, 0.085}, {0.047, 0.085, 0.060}, -38), 0.04);  // calf
  leg = blended(leg, tapered_capsule(kFoot - Vector3d(0, 0.025, 0.02), kToe, 0.050, 0.042), 0.04);
  return blended(leg, ellipsoid({0.218, 0.038, 0.225}, {0.058, 0.038, 0.088}), 0.03);
}

Solid arm_solid() {
  Solid arm = tapered_capsule(kUpperArm, kForearm, 0.046, 0.034);
  arm = blended(arm, tapered_capsule(kForearm, kHand, 0.034, 0.026), 0.02);
  return blended(arm, ellipsoid(0.5 * (kHand + kFingers), {0.030, 0.026, 0.050}, 15), 0.02);
}

Solid tail_solid() {
  Solid tail = tapered_capsule(kHips, kTail[0], 0.15, kTailRadius[0]);
  for (std::size_t i = 0; i + 1 < kTail.size(); ++i)
    tail = blended(tail, tapered_capsule(kTail[i], kTail[i + 1], kTailRadius[i], kTailRadius[i + 1]), 0.006);
  return tail;
}

Solid head_solid() {
  Solid head = ellipsoid({0, 1.065, 0.085}, {0.108, 0.112, 0.115});
  head = blended(head, tapered_capsule({0, 1.045, 0.13}, {0, 1.015, 0.235}, 0.078, 0.052), 0.05);  // snout
  head = blended(head, mirrored(ellipsoid({0.050, 1.010, 0.150}, {0.045, 0.042, 0.052})), 0.04);   // cheeks
  head = blended(head, ellipsoid({0, 1.036, 0.283}, {0.027, 0.020, 0.018}), 0.010);                // nose
  head = blended(head, mirrored(ellipsoid({0.060, 1.105, 0.166}, {0.024, 0.031, 0.024})), 0.008);  // eyes
  const Solid ear = ellipsoid(0.5 * (kEar1 + kEarTip), {0.046, 0.165, 0.027}, -12.5, -17);
  return blended(head, mirrored(ear), 0.045);
}

Solid hopper_solid() {
  Solid body = ellipsoid({0, 0.515, -0.055}, {0.190, 0.190, 0.195});                    // hips
  body = blended(body, ellipsoid({0, 0.575, 0.055}, {0.205, 0.225, 0.200}, -8), 0.08);  // belly
  body = blended(body, ellipsoid({0, 0.790, 0.005}, {0.140, 0.150, 0.125}, 15), 0.10);  // chest
  body = blended(body, tapered_capsule(kNeck - Vector3d(0, 0.05, 0.01), kHead, 0.088, 0.072), 0.06);
  body = blended(body, tail_solid(), 0.09);
  body = blended(body, mirrored(leg_solid()), 0.035);
  body = blended(body, mirrored(arm_solid()), 0.035);
  return blended(body, head_solid(), 0.05);
}

std::vector<WeightBone> weight_bones(const std::vector<SampleJoint>& list) {
  std::vector<WeightBone> bones;
  const auto add = [&](const std::string& joint, const Vector3d& a, const Vector3d& b, double ra, double rb) {
    bones.push_back({joint_index(list, joint), a, b, ra, rb});
  };
  add("hips", kHips - Vector3d(0, 0.06, 0), kSpine, 0.18, 0.19);
  add("spine", kSpine, kChest, 0.19, 0.14);
  add("hips", {0, 0.45, 0.02}, {0, 0.57, 0.06}, 0.17,
      0.20);  // the belly rests on the hips, not on the thighs
  add("spine", {0, 0.60, 0.06}, {0, 0.72, 0.03}, 0.20, 0.16);
  add("chest", kChest, kNeck, 0.14, 0.09);
  add("neck", kNeck, kHead, 0.09, 0.08);
  add("head", kHead, {0, 1.10, 0.09}, 0.09, 0.11);
  add("head", {0, 1.045, 0.13}, {0, 1.015, 0.235}, 0.078, 0.052);
  for (std::size_t i = 0; i + 1 < kTail.size(); ++i)
    add(tail_name(i + 1), kTail[i], kTail[i + 1], kTailRadius[i], kTailRadius[i + 1]);
  for (const auto& [side, sign] : {std::pair<std::string, double>{"_l", 1.0}, {"_r", -1.0}}) {
    const auto limb = [&, s = sign, suffix = side](const char* joint, const Vector3d& a, const Vector3d& b,
                                                   double ra, double rb) {
      add(joint + suffix, {s * a.x(), a.y(), a.z()}, {s * b.x(), b.y(), b.z()}, ra, rb);
    };
    limb("ear_1", kEar1, kEar2, 0.030, 0.040);
    limb("ear_2", kEar2, kEarTip, 0.040, 0.020);
    limb("upper_arm", kUpperArm, kForearm, 0.046, 0.034);
    limb("forearm", kForearm, kHand, 0.034, 0.026);
    limb("hand", kHand, kFingers, 0.026, 0.026);
    limb("thigh", kThigh, kShin, 0.110, 0.070);
    limb("shin", kShin, kFoot, 0.052, 0.038);
    limb("foot", kFoot, kToe, 0.042, 0.042);
    limb("toe", kToe, kToeTip, 0.042, 0.030);
  }
  return bones;
}

/// Cream belly and snout, rosy ear insides, dark nose, eyes and paws over a warm brown.
std::array<std::uint8_t, 4> fur_colour(const Vector3d& p) {
  const double x = std::abs(p.x());
  const Vector3d brown(0.62, 0.36, 0.20), cream(0.93, 0.80, 0.62), rose(0.87, 0.55, 0.48),
      dark(0.07, 0.05, 0.05), paw(0.36, 0.20, 0.12);
  const auto within = [&](const Solid& solid) { return solid(Vector3d(x, p.y(), p.z())) < 0.0; };
  Vector3d colour = brown;
  if (within(ellipsoid({0, 0.60, 0.24}, {0.125, 0.27, 0.13}, -4)) ||
      within(ellipsoid({0, 0.99, 0.25}, {0.09, 0.036, 0.11}, 10)))
    colour = cream;
  if (within(ellipsoid(0.5 * (kEar1 + kEarTip) + Vector3d(0.004, 0.004, 0.036), {0.026, 0.13, 0.032}, -12.5,
                       -17)))
    colour = rose;
  if (p.y() < 0.075 && p.z() > 0.215) colour = paw;
  if (within(ellipsoid({0.281, 0.648, 0.212}, {0.05, 0.04, 0.035}))) colour = paw;
  if (within(ellipsoid({0, 1.036, 0.292}, {0.028, 0.021, 0.020})) ||
      within(ellipsoid({0.062, 1.106, 0.180}, {0.021, 0.028, 0.020})))
    colour = dark;
  std::array<std::uint8_t, 4> bytes{0, 0, 0, 255};
  for (std::size_t c = 0; c < 3; ++c)
    bytes[c] = static_cast<std::uint8_t>(std::floor(255.0 * colour[static_cast<Eigen::Index>(c)] + 0.5));
  return bytes;
}

// --- motion ---

/// (y, z) of a joint.
Vector2d sagittal(const Vector3d& p) { return {p.y(), p.z()}; }

/// (y, z) turned about x.
Vector2d turned(const Vector2d& v, double degrees) {
  const SineCosine r = sine_cosine(degrees);
  return {r.cosine * v.x() - r.sine * v.y(), r.sine * v.x() + r.cosine * v.y()};
}

/// Angle [degrees] of the turn about x that carries direction a to direction b, by bisection on exact sines.
double angle_between(const Vector2d& a, const Vector2d& b) {
  const double cross = a.x() * b.y() - a.y() * b.x(), dot = a.dot(b);
  const double target = dot / std::sqrt(dot * dot + cross * cross);
  double low = 0.0, high = 180.0;
  for (int i = 0; i < 50; ++i) {
    const double middle = 0.5 * (low + high);
    (sine_cosine(middle).cosine > target ? low : high) = middle;
  }
  return cross < 0.0 ? -low : low;
}

/// What the legs are told to do: where the hips are and where the ball of the foot is.
struct Stance {
  Vector2d hips_offset;  ///< (y, z) [m].
  double hips_pitch;     ///< [degrees].
  Vector2d toe;          ///< (y, z) of the toe joint [m].
  double heel;           ///< lift of the heel about the toe joint [degrees].
  double toe_pitch;      ///< of the toes against the ground [degrees].
};

/// Two-bone inverse kinematics in the sagittal plane: the knee bends forward, the foot keeps its own pitch.
void place_leg(const std::vector<SampleJoint>& list, const Stance& stance, const std::string& side,
               std::vector<JointPose>& pose) {
  const Vector2d hips = sagittal(kHips) + stance.hips_offset;
  const Vector2d hip = hips + turned(sagittal(kThigh) - sagittal(kHips), stance.hips_pitch);
  const Vector2d ankle = stance.toe + turned(sagittal(kFoot) - sagittal(kToe), stance.heel);
  const Vector2d thigh = sagittal(kShin) - sagittal(kThigh), shin = sagittal(kFoot) - sagittal(kShin);
  const double a = thigh.norm(), b = shin.norm();
  Vector2d reach = ankle - hip;
  const double longest = 0.995 * (a + b);
  if (reach.norm() > longest) reach *= longest / reach.norm();
  const double d = reach.norm();
  const double along = (a * a - b * b + d * d) / (2.0 * d);
  const double aside = std::sqrt(std::max(a * a - along * along, 0.0));
  const Vector2d forward = Vector2d(reach.y(), -reach.x()) / d;  // for a leg pointing down: +z
  const Vector2d knee = along / d * reach + (forward.y() >= 0.0 ? 1.0 : -1.0) * aside * forward;
  const double thigh_turn = angle_between(thigh, knee);
  const double shin_turn = angle_between(shin, reach - knee);
  const auto pitch = [&](const char* name) -> double& {
    return pose[static_cast<std::size_t>(joint_index(list, name + side))].degrees.x();
  };
  pitch("thigh") = thigh_turn - stance.hips_pitch;
  pitch("shin") = shin_turn - thigh_turn;
  pitch("foot") = stance.heel - shin_turn;
  pitch("toe") = stance.toe_pitch - stance.heel;
}

void set_pitch(const std::vector<SampleJoint>& list, const std::string& name, double degrees,
               std::vector<JointPose>& pose) {
  pose[static_cast<std::size_t>(joint_index(list, name))].degrees.x() = degrees;
}

constexpr double kGravity = 9.81;                                                   // [m/s^2]
constexpr double kTakeOff1 = 0.42, kLand1 = 0.88, kTakeOff2 = 1.26, kLand2 = 1.74;  // [s]

/// Height of the hips over rest [m]: parabolas in flight, joined smoothly to crouches.
double hips_height(double t) {
  constexpr double kStretch = 0.13;  // at take-off and landing
  const double v1 = 0.5 * kGravity * (kLand1 - kTakeOff1), v2 = 0.5 * kGravity * (kLand2 - kTakeOff2);
  const auto flight = [&](double since, double v) {
    return kStretch + v * since - 0.5 * kGravity * since * since;
  };
  static const Curve first = Curve({{0, 0}, {0.26, -0.10}, {kTakeOff1, kStretch}}).with_slope(2, v1);
  static const Curve second =
      Curve({{kLand1, kStretch}, {1.03, -0.11}, {1.10, -0.112}, {kTakeOff2, kStretch}})
          .with_slope(0, -v1)
          .with_slope(3, v2);
  static const Curve last = Curve({{kLand2, kStretch}, {1.91, -0.12}, {2.35, 0.0}}).with_slope(0, -v2);
  if (t < kTakeOff1) return first(t);
  if (t < kLand1) return flight(t - kTakeOff1, v1);
  if (t < kTakeOff2) return second(t);
  if (t < kLand2) return flight(t - kTakeOff2, v2);
  return last(t);
}

Stance hop_stance(double t) {
  static const Curve hips_z({{0, 0},
                             {0.28, -0.03},
                             {0.42, 0.05},
                             {0.65, 0.02},
                             {0.88, -0.04},
                             {1.07, -0.03},
                             {1.26, 0.05},
                             {1.50, 0.02},
                             {1.74, -0.04},
                             {1.90, -0.03},
                             {2.35, 0}});
  static const Curve pitch({{0, 0},
                            {0.28, 16},
                            {0.45, -6},
                            {0.65, 6},
                            {0.88, 4},
                            {1.06, 10},
                            {1.29, -6},
                            {1.50, 7},
                            {1.74, 4},
                            {1.92, 11},
                            {2.40, 0}});
  static const Curve toe_y({{0.42, 0}, {0.65, 0.33}, {0.88, 0}, {1.26, 0}, {1.50, 0.36}, {1.74, 0}});
  static const Curve toe_z(
      {{0.42, 0}, {0.55, -0.07}, {0.78, 0.05}, {0.88, 0}, {1.26, 0}, {1.39, -0.07}, {1.63, 0.05}, {1.74, 0}});
  static const Curve heel(
      {{0.30, 0}, {0.44, 52}, {0.70, 22}, {0.88, 0}, {1.12, 0}, {1.28, 52}, {1.55, 22}, {1.74, 0}});
  static const Curve toes(
      {{0.40, 0}, {0.52, 34}, {0.75, -6}, {0.88, 0}, {1.24, 0}, {1.36, 34}, {1.60, -6}, {1.74, 0}});
  return {
      {hips_height(t), hips_z(t)}, pitch(t), sagittal(kToe) + Vector2d(toe_y(t), toe_z(t)), heel(t), toes(t)};
}

void hop(const std::vector<SampleJoint>& list, double t, std::vector<JointPose>& pose) {
  const Stance stance = hop_stance(t);
  auto& hips = pose[static_cast<std::size_t>(joint_index(list, "hips"))];
  hips.offset = {0, stance.hips_offset.x(), stance.hips_offset.y()};
  hips.degrees.x() = stance.hips_pitch;
  place_leg(list, stance, "_l", pose);
  place_leg(list, stance, "_r", pose);
  const double lean = stance.hips_pitch;  // the back follows, the head stays level
  set_pitch(list, "spine", 0.5 * lean, pose);
  set_pitch(list, "chest", 0.3 * lean, pose);
  set_pitch(list, "neck", -0.8 * lean, pose);
  set_pitch(list, "head", -0.9 * lean, pose);
  static const Curve tail({{0, 0},
                           {0.28, 5},
                           {0.46, -3},
                           {0.70, 9},
                           {0.92, 0},
                           {1.08, 6},
                           {1.30, -3},
                           {1.54, 9},
                           {1.78, 0},
                           {1.96, 6},
                           {2.45, 0}});
  for (std::size_t i = 1; i <= 6; ++i)
    set_pitch(list, tail_name(i), tail(t - 0.025 * static_cast<double>(i - 1)) - (i == 1 ? 0.8 * lean : 0.0),
              pose);
  static const Curve ears({{0, 0},
                           {0.28, 6},
                           {0.46, -16},
                           {0.72, -2},
                           {0.90, 6},
                           {1.06, 10},
                           {1.30, -16},
                           {1.56, -2},
                           {1.76, 6},
                           {1.92, 10},
                           {2.40, 0}});
  static const Curve arms({{0, 0},
                           {0.28, 18},
                           {0.46, -28},
                           {0.72, -12},
                           {0.92, -6},
                           {1.08, 18},
                           {1.30, -28},
                           {1.56, -12},
                           {1.78, -6},
                           {1.95, 18},
                           {2.45, 0}});
  for (const std::string side : {"_l", "_r"}) {
    set_pitch(list, "ear_1" + side, ears(t), pose);
    set_pitch(list, "ear_2" + side, 1.2 * ears(t - 0.04), pose);
    set_pitch(list, "upper_arm" + side, arms(t), pose);
    set_pitch(list, "forearm" + side, 0.5 * arms(t - 0.03), pose);
    set_pitch(list, "hand" + side, -0.6 * arms(t - 0.05), pose);
  }
}

void look(const std::vector<SampleJoint>& list, double t, std::vector<JointPose>& pose) {
  const auto turn = [&](const std::string& name) -> Vector3d& {
    return pose[static_cast<std::size_t>(joint_index(list, name))].degrees;
  };
  static const Curve yaw({{0, 0}, {0.45, 50}, {0.95, 50}, {1.45, -50}, {1.85, -50}, {2.3, 0}});
  turn("head").y() = 0.62 * yaw(t);
  turn("neck").y() = 0.28 * yaw(t + 0.03);
  turn("chest").y() = 0.10 * yaw(t + 0.05);
  static const Curve tilt({{0, 0}, {0.6, 8}, {1.0, 8}, {1.6, -8}, {1.9, -8}, {2.3, 0}});
  turn("head").z() = tilt(t);
  static const Curve flick_l({{0.70, 0}, {0.78, 32}, {0.88, -6}, {0.96, 26}, {1.10, 0}});
  static const Curve flick_r({{1.62, 0}, {1.70, 32}, {1.80, -6}, {1.88, 26}, {2.02, 0}});
  turn("ear_1_l").z() = -0.7 * flick_l(t);
  turn("ear_2_l").z() = -flick_l(t - 0.02);
  turn("ear_1_r").z() = 0.7 * flick_r(t);
  turn("ear_2_r").z() = flick_r(t - 0.02);
  static const Curve sway({{0, 0}, {0.5, 11}, {1.1, -12}, {1.7, 11}, {2.3, 0}});
  for (std::size_t i = 1; i <= 6; ++i) turn(tail_name(i)).y() = sway(t - 0.06 * static_cast<double>(i - 1));
}

}  // namespace

assets::GlbScene make_hopper() {
  const std::vector<SampleJoint> list = joints();
  const SkinMesh mesh = polygonise(
      hopper_solid(), {.low = {-0.34, -0.03, -1.10}, .high = {0.34, 1.50, 0.40}, .spacing = 0.021});
  assets::GlbPrimitive skin{mesh.points,
                            vertex_normals(mesh.points, mesh.triangles),
                            mesh.triangles,
                            0,
                            {},
                            heat_weights(mesh, weight_bones(list), mirror_joints(list))};
  for (Eigen::Index v = 0; v < mesh.points.rows(); ++v)
    skin.colours.push_back(fur_colour(mesh.points.row(v).transpose()));
  assets::GlbScene scene;
  scene.materials = {{"fur", {1, 1, 1}, 0.85, false}};
  scene.meshes = {{"hopper", {skin}}};
  add_skeleton(list, scene);
  scene.nodes.push_back({.name = "hopper", .mesh = 0, .skinned = true});
  scene.clips = {
      make_clip("hop", 2.8, list, [&](double t, std::vector<JointPose>& pose) { hop(list, t, pose); }),
      make_clip("look", 2.6, list, [&](double t, std::vector<JointPose>& pose) { look(list, t, pose); })};
  return scene;
}

}  // namespace sinew::samples
