#pragma once

#include <vector>

#include "lattice/surface.h"
#include "skeleton/skeleton.h"

/// What hangs on every joint of a rig, read off its skin alone: no lattice changes it.
namespace sinew::fem {

/// The flesh whose skin follows one joint more than any other. Its bones are the segments to the joints below
/// it that carry flesh, and of a joint at the end of a limb one towards the middle of its skin.
struct JointFlesh {
  double area = 0.0;    ///< of its skin [m^2]; 0: there is none, and the rest says nothing.
  double radius = 0.0;  ///< area-weighted median distance of the skin from the bone [m].
  /// Half of how thick the flesh is [m]: the mean over the skin of how far it lies outwards from the bone,
  /// n . (p - foot). The radius of a limb; of a fin or wing beside its bone half the thickness of the sheet.
  double half_thickness = 0.0;
  /// How far flesh stands out from the bone beyond its own half thickness [m]: what hangs free, like a
  /// cantilever.
  double overhang = 0.0;
  /// How far it goes on beyond the end of a bone that ends a limb [m]; 0 of other joints.
  double tip = 0.0;
  std::vector<int> ends;  ///< joints at the ends of its bones, itself first.
};

/// One per joint. `skin.weights` name joints of `skeleton`, one list per vertex.
std::vector<JointFlesh> joint_flesh(const lattice::Surface& skin, const skeleton::Skeleton& skeleton);

/// Area-weighted median distance of all skin from its bones [m]: how thick the character's limbs are,
/// whatever the number of joints in them.
double typical_radius(const lattice::Surface& skin, const skeleton::Skeleton& skeleton);

}  // namespace sinew::fem
