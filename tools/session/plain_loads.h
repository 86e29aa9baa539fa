#pragma once

#include "fem/forces/loads.h"
#include "tools/scene/plain_scene.h"

/// What drives the flesh of a plain scene besides gravity and bones.
namespace sinew::tools {

/// Its loads in fem's terms.
fem::Loads loads_of(const PlainScene& plain);

/// The velocity that points at `x` start with: num_points x 3 [m], and [m/s] in the result.
lattice::Points starting_velocity(const PlainScene& plain, const lattice::Points& x);

}  // namespace sinew::tools
