#include "lattice/control_lattice.h"

namespace sinew::lattice {}
