// Props of public trials through `sinew simulate`: eyes and teeth in a head, a sword in a hand.

#include <map>
#include <numbers>

#include <Eigen/SVD>

#include "tests/tools/simulate_run.h"

namespace sinew::tests {
namespace {

/// Rows of one named part in every frame of a run.
struct PartOfRun {
  Eigen::MatrixX3d rest;
  std::vector<Eigen::MatrixX3d> frames;
};

PartOfRun part_of(const fs::path& folder, const std::string& name) {
  const nlohmann::json sidecar = nlohmann::json::parse(read(folder / "skin.json"));
  Eigen::Index first = 0, count = 0;
  for (const auto& part : sidecar["parts"]) {
    count = part["vertex_count"].get<int>();
    if (part["name"] == name) break;
    first += count;
  }
  PartOfRun part;
  part.rest = assets::read_surface((folder / "skin.obj").string()).points.middleRows(first, count);
  const assets::Pc2Reader cache((folder / "skin.pc2").string());
  for (int k = 0; k < cache.num_samples(); ++k)
    part.frames.emplace_back(cache.read(k).middleRows(first, count).cast<double>());
  return part;
}

/// Largest change of a distance between two vertices, all pairs [units of the file].
double change_of_shape(const Eigen::MatrixX3d& rest, const Eigen::MatrixX3d& now) {
  double worst = 0.0;
  for (Eigen::Index a = 0; a < rest.rows(); ++a)
    for (Eigen::Index b = 0; b < a; ++b)
      worst =
          std::max(worst, std::abs((now.row(a) - now.row(b)).norm() - (rest.row(a) - rest.row(b)).norm()));
  return worst;
}

/// Angle of the turn that takes one set of points closest to another [degrees].
double turn_between(const Eigen::MatrixX3d& from, const Eigen::MatrixX3d& to) {
  const Eigen::Matrix3d c =
      (to.rowwise() - to.colwise().mean()).transpose() * (from.rowwise() - from.colwise().mean());
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(c, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Matrix3d turn = svd.matrixU() * svd.matrixV().transpose();
  return std::acos(std::clamp((turn.trace() - 1.0) / 2.0, -1.0, 1.0)) * 180.0 / std::numbers::pi;
}

class Props : public Simulate {
 protected:
  std::string run_trial(const std::string& trial, const std::string& name, const std::string& flags) const {
    const fs::path rig = fs::path(SINEW_SHARED_DIR) / "data/public/trials/flesh" / trial;
    EXPECT_TRUE(fs::exists(rig)) << rig << " is missing";
    const Outcome outcome = run(command_line("simulate " + quoted(rig) + " -o " + quoted(out(name)) +
                                             " --frames 0-20 --cells 300 --preview off " + flags));
    EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
    return outcome.text;
  }
};

// Frames are floats of up to 2 m: a distance of two points is off by up to 4e-7 m.
constexpr double kRounding = 1e-6;

TEST_F(Props, EyesAndTeethKeepTheirShapeAndGaze) {
  const std::string said = run_trial("eyes_hop.glb", "eyes", "");
  EXPECT_NE(said.find("teeth (island of 42 vertices on 'head'): riding, hangs on one joint"),
            std::string::npos)
      << said;
  run_trial("eyes_hop.glb", "plain", "--model skin --offset 0");
  double carried = 0.0;
  for (const char* name : {"eye-1", "eye+1", "teeth"}) {
    const PartOfRun part = part_of(out("eyes"), name), plain = part_of(out("plain"), name);
    for (std::size_t k = 0; k < part.frames.size(); ++k) {
      EXPECT_LE(change_of_shape(part.rest, part.frames[k]), kRounding) << name << ", frame " << k;
      EXPECT_LE(turn_between(plain.frames[k], part.frames[k]), 0.1) << name << ", frame " << k;
      carried = std::max(carried, (part.frames[k] - plain.frames[k]).rowwise().norm().maxCoeff());
    }
  }
  EXPECT_GT(carried, 1e-3);  // the head's flesh moves, and takes them along
}

TEST_F(Props, ASwordKeepsItsLengthAndItsPlace) {
  const std::string said = run_trial("sword.glb", "sword", "--height 0.1");
  EXPECT_NE(said.find("sword (island of 44 vertices on 'hand'): skinned"), std::string::npos) << said;
  run_trial("sword.glb", "plain", "--height 0.1 --model skin --offset 0");
  const PartOfRun part = part_of(out("sword"), "sword"), plain = part_of(out("plain"), "sword");
  for (std::size_t k = 0; k < part.frames.size(); ++k) {
    EXPECT_LE(change_of_shape(part.rest, part.frames[k]), kRounding) << "frame " << k;
    EXPECT_TRUE(part.frames[k] == plain.frames[k]) << "frame " << k;
  }
}

}  // namespace
}  // namespace sinew::tests
