// Rigs with one fault each, and rigs of other people that have one: repaired with a word, or refused with
// one.
#include <algorithm>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "assets/error.h"
#include "assets/rig.h"

namespace sinew::assets {
namespace {

using testing::HasSubstr;

std::string shared(const std::string& path) { return std::string(SINEW_SHARED_DIR) + "/data/public/" + path; }

struct Trial {
  const char* file;
  const char* finding;  ///< code of what must be said; empty: nothing but facts.
  const char* error;    ///< what refuses it; empty: it can be simulated.
};

TEST(TrialRigs, AreRepairedOrRefusedWithAWord) {
  const std::vector<Trial> trials{
      {"creatures/daz_lumberjack_geometry.glb", "bind-matrix-ignored", ""},
      {"creatures/mesh2motion_bird-animations.glb", "", ""},
      {"creatures/mesh2motion_quad-creature-animations.glb", "clip-faulty", ""},
      {"creatures/q_Snake.glb", "", ""},
      {"creatures/q_Spider.glb", "", ""},
      {"creatures/q_Wasp.glb", "weights-not-numbers", ""},
      {"creatures/quaternius_Bunny.gltf", "", ""},
      {"trials/bad_clip_of_several/equal_times.glb", "",
       "clip 'bend': node 'bone1': rotation: key 2: times do not"},
      {"trials/bad_clip_of_several/second_clip_keys_twice.glb", "clip-faulty", ""},
      {"trials/character_in_other_scene/character_in_scene1.glb", "other-scene-taken", ""},
      {"trials/clip_starts_late/starts_at_10s.glb", "", ""},
      {"trials/draco_used_not_required/limb.glb", "",
       "extension 'KHR_draco_mesh_compression' is not supported"},
      {"trials/inside_out/inside_out.glb", "shells-inside-out", ""},
      {"trials/nan_weight/nan_weight_one_vertex.glb", "weights-not-numbers", ""},
      {"trials/one_key_pose/pose_clip.glb", "clip-is-a-pose", ""},
      {"trials/pointer_channel/pointer_in_second_clip.glb", "channels-ignored", ""},
      {"trials/scale_zero/scale_from_zero.glb", "flesh-scaled-to-nothing", ""},
      {"trials/scale_zero/scale_neg.glb", "flesh-scaled-to-nothing", ""},
      {"trials/scale_zero/scale_to_zero.glb", "flesh-scaled-to-nothing", ""},
      {"trials/skin_without_ibm/no_ibm.glb", "", ""},
      {"trials/skin_without_ibm/unused_skin_without_ibm.glb", "", ""},
      {"trials/two_instances/crowd_two.glb", "", ""},
      {"trials/unweighted_joint_identity_ibm/bad.glb", "bind-matrix-ignored", ""},
      {"trials/unweighted_joint_identity_ibm/good.glb", "", ""},
  };
  for (const Trial& trial : trials) {
    SCOPED_TRACE(trial.file);
    try {
      const Rig rig = load_rig(shared(trial.file), {0.0, SINEW_IMPORTER});
      EXPECT_STREQ(trial.error, "");
      const std::string code = trial.finding;
      bool said = code.empty();
      for (const Finding& finding : rig.findings) {
        EXPECT_NE(finding.severity, Finding::Severity::Error) << finding.message;
        said = said || finding.code == code;
        const bool has_warning = finding.severity == Finding::Severity::Warning;
        EXPECT_FALSE(code.empty() && has_warning) << finding.message;
      }
      EXPECT_TRUE(said);
    } catch (const InputError& e) {
      EXPECT_STRNE(trial.error, "") << e.what();
      EXPECT_THAT(e.what(), HasSubstr(trial.error));
    }
  }
}

TEST(TrialRigs, WithALooseJointMoveAsWithoutItsFault) {
  const std::string folder = "trials/unweighted_joint_identity_ibm/";
  const Rig bad = load_rig(shared(folder + "bad.glb"), {0.0, SINEW_IMPORTER});
  const Rig good = load_rig(shared(folder + "good.glb"), {0.0, SINEW_IMPORTER});
  for (const double time : {0.0, 0.3, 0.7, 1.0}) {
    const auto maps = [&](const Rig& rig) {
      return skeleton::pose_from_rest(rig.skeleton, skeleton::sample(rig.skeleton, rig.clips[0], time));
    };
    const auto a = maps(bad), b = maps(good);
    ASSERT_EQ(a.size(), b.size());
    // The files hold single precision numbers of order 100.
    for (std::size_t j = 0; j < a.size(); ++j)
      EXPECT_TRUE(a[j].isApprox(b[j], 1e-4)) << time << " joint " << j;
  }
}

TEST(TrialRigs, HaveTheSizeTheyState) {
  const Rig wing = load_rig(shared("trials/wing_tip/wing.glb"), {0.0, SINEW_IMPORTER});
  const lattice::Points& points = wing.parts[0].points;
  EXPECT_NEAR((points.colwise().maxCoeff() - points.colwise().minCoeff()).maxCoeff(), 1.0, 1e-6);
}

TEST(TrialRigs, OnTwoSkeletonsStandApart) {
  const Rig crowd = load_rig(shared("trials/two_instances/crowd_two.glb"), {0.0, SINEW_IMPORTER});
  ASSERT_EQ(crowd.parts.size(), 2u);
  const lattice::Points apart = crowd.parts[1].points - crowd.parts[0].points;
  EXPECT_LT((apart.rowwise() - Eigen::RowVector3d(1, 0, 0)).cwiseAbs().maxCoeff(), 1e-6);
}

}  // namespace
}  // namespace sinew::assets
