#pragma once

namespace sinew::lattice {

/// Changes whenever the builder may give other lattices: a hash of this library's sources, with the versions
/// of the compiler and of CGAL.
const char* builder_version();

}  // namespace sinew::lattice
