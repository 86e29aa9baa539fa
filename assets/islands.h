#pragma once

#include <string>
#include <vector>

#include "assets/rig.h"

/// Pieces of the skin that hang together, and what becomes of each: flesh, or a prop that keeps its shape.
namespace sinew::assets {

/// One piece: what triangles and coincident points hold together of one part of the rig, or of several.
struct Island {
  /// The part's where the part is one island, else "part/joint", numbered from 2 on where that is taken.
  std::string name;
  std::vector<int> vertices;     ///< of the rig (part by part), ascending.
  lattice::Triangles triangles;  ///< of rig vertices, num_triangles x 3.
  /// The joint that it hangs on alone, with at least kOneJoint of its weight; -1 where there is none.
  int joint = -1;
  double area = 0.0;                    ///< [m^2].
  bool is_skinned = false;              ///< the file binds it by weights; else it is a mesh under a joint.
  PartRole role = PartRole::Simulated;  ///< chosen by itself.
  std::string reason;                   ///< of the role, where it is not Simulated.
};

/// An island hangs on one joint where that has this share of its weights [-]: auto-weights leave traces.
inline constexpr double kOneJoint = 0.99;

/// The islands of all parts that move, in the order of their first vertices, each with the role that suits
/// it. Flesh is what hangs on several joints, and what fills a limb: a piece that holds the bone of its joint
/// where nothing else does. Everything else on one joint is a prop. One whose surroundings hold it on enough
/// sides rides on them; where it reaches far beyond, like a sword, the rig's skinning moves it. The rig's
/// props are not looked at.
std::vector<Island> find_islands(const Rig& rig);

/// Makes the islands' roles those of the rig: fills `props` with everything that is not Simulated and gives
/// unskinned islands that became flesh the weights of their joint. Throws ConfigError naming the island where
/// a rigid one hangs on several joints, or no flesh is near one that is to ride.
void set_roles(Rig& rig, const std::vector<Island>& islands);

}  // namespace sinew::assets
