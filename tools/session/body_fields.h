#pragma once

#include "assets/lattice_files.h"
#include "fem/body/body.h"

namespace sinew::tools {

/// What a run made of its lattice, to look at. Per cell: fill [-] and level (finest subdivision with active
/// functions), young [Pa], poisson [-] and density [kg/m^3] as means over its flesh (NaN where there is
/// none). Per vertex: the weight of every region [-], "region <frame>" or "region <parent>-<child>" (with the
/// share of the child where a joint has two); they sum to 1 where there is flesh round the vertex.
assets::LatticeFields body_fields(const fem::Body& body);

}  // namespace sinew::tools
